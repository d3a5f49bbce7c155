// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/view_input.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace lenticule::frames {

ViewInput::ViewInput(std::vector<std::unique_ptr<FrameSource>> pictures,
                     std::unique_ptr<ViewArrangement> arrangement, std::string name)
    : arrangement_(std::move(arrangement)), name_(std::move(name)), shape_(arrangement_->shape()) {
  LENTICULE_CHECK(!pictures.empty());
  for (auto& source : pictures) streams_.push_back({.source = std::move(source)});
  const std::optional<uint64_t> frames = streams_.front().source->frame_count();
  for (const Stream& stream : streams_)
    if (const auto others = stream.source->frame_count(); frames && others && frames != others)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: one part has {} frames, another {}", name_, *frames, *others),
                  "every part needs a picture for each frame");
}

ViewInput::ViewInput(ViewSet still)
    : shape_(shape_of(still)), views_(std::move(still)), still_(true) {}

ViewInput::~ViewInput() {
  release();
}

FrameDamage ViewInput::damage() const {
  FrameDamage sum;
  for (const Stream& stream : streams_) sum += stream.source->damage();
  return sum;
}

std::string ViewInput::video_decoder() const {
  for (const Stream& stream : streams_)
    if (std::string name = stream.source->video_decoder(); !name.empty()) return name;
  return {};
}

std::optional<Rate> ViewInput::rate() const {
  return still_ ? std::nullopt : streams_.front().source->rate();
}

std::optional<uint64_t> ViewInput::frame_count() const {
  return still_ ? std::optional<uint64_t>(1) : streams_.front().source->frame_count();
}

PullStatus ViewInput::fail(std::string why) {
  failure_ = std::move(why);
  return PullStatus::Failed;
}

PullStatus ViewInput::pull_all() {
  bool waits = false, some_ended = false, some_here = false;
  for (Stream& stream : streams_) {
    if (!stream.acquired && !stream.ended) {
      AcquiredFrame acquired;
      const PullStatus status = stream.source->pull(acquired);
      if (status == PullStatus::Failed) return fail(stream.source->failure());
      if (status == PullStatus::Ready) stream.acquired = acquired;
      stream.ended = status == PullStatus::End;
      waits = waits || status == PullStatus::NotYet;
    }
    some_ended = some_ended || stream.ended;
    some_here = some_here || stream.acquired.has_value();
  }
  if (waits) return PullStatus::NotYet;
  if (some_ended && some_here) return fail(name_ + ": one part ends before another");
  return some_ended ? PullStatus::End : PullStatus::Ready;
}

PullStatus ViewInput::next() {
  if (!failure_.empty()) return PullStatus::Failed;
  if (still_) return std::exchange(still_given_, true) ? PullStatus::End : PullStatus::Ready;
  const PullStatus status = pull_all();
  if (status == PullStatus::Ready) number_ = streams_.front().acquired->number;
  return status;
}

const ViewSet& ViewInput::views() {
  if (!views_) {
    std::vector<FrameView> pictures;
    pictures.reserve(streams_.size());
    for (const Stream& stream : streams_) pictures.push_back(stream.acquired->frame);
    views_ = arrangement_->arrange(pictures);
  }
  return *views_;
}

void ViewInput::release() {
  if (still_) return;
  views_.reset();
  for (Stream& stream : streams_)
    if (const auto acquired = std::exchange(stream.acquired, std::nullopt))
      stream.source->release(acquired->token);
}

bool ViewInput::rewind() {
  if (still_) {
    still_given_ = false;
    return true;
  }
  for (Stream& stream : streams_) {
    if (!stream.source->rewind()) return false;
    stream.ended = false;
  }
  return true;
}

void ViewInput::wait(std::chrono::milliseconds longest) {
  std::vector<pollfd> wakes;
  for (const Stream& stream : streams_)
    if (!stream.acquired && !stream.ended && stream.source->wake_fd() >= 0)
      wakes.push_back({.fd = stream.source->wake_fd(), .events = POLLIN, .revents = 0});
  (void)poll(wakes.data(), wakes.size(), static_cast<int>(longest.count()));
  for (Stream& stream : streams_) stream.source->service();
}

}  // namespace lenticule::frames
