// SPDX-License-Identifier: Apache-2.0
#include "frames/views_input/view_input.h"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <utility>

#include "base/error.h"
#include "frames/weave.h"
#include "frames/weaving/reweave.h"

namespace lenticule::frames {
namespace {

/// Returns the shape; by default its pixels are square.
ViewShape shape_of(int count, int width, int height, std::optional<double> aspect) {
  return {.count = count,
          .width = width,
          .height = height,
          .aspect = aspect.value_or(static_cast<double>(width) / height)};
}

/// Stored takes views as the pictures hold them: tiles of one, or one per picture.
class Stored final : public ViewArrangement {
 public:
  Stored(const ViewShape& shape, const std::optional<QuiltLayout>& quilt, bool rightmost_first)
      : shape_(shape), quilt_(quilt), rightmost_first_(rightmost_first) {}
  ViewShape shape() const override { return shape_; }
  ViewSet arrange(std::span<const FrameView> pictures) override {
    ViewSet views = quilt_ ? ViewSet::borrow(pictures.front(), *quilt_)
                           : ViewSet::borrow(pictures, shape_.aspect);
    return rightmost_first_ ? std::move(views).reversed() : std::move(views);
  }

 private:
  ViewShape shape_;
  std::optional<QuiltLayout> quilt_;
  bool rightmost_first_;
};

class ColourAndDepth final : public ViewArrangement {
 public:
  ColourAndDepth(const TileSize& colour, const std::optional<DepthWindows>& inside,
                 std::optional<double> aspect, const DepthOptions& options)
      : inside_(inside),
        drawn_(colour.width, colour.height, options),
        shape_(shape_of(options.views, colour.width, colour.height, aspect)) {}
  ViewShape shape() const override { return shape_; }
  ViewSet arrange(std::span<const FrameView> pictures) override {
    const FrameView& picture = pictures.front();
    const auto window = [&](const DepthWindows::Window& part) {
      return PictureWindow{.pixels = picture.row(part.top) + static_cast<size_t>(part.left) * 3,
                           .stride_bytes = picture.geometry.row_bytes(),
                           .width = part.size.width,
                           .height = part.size.height};
    };
    const auto views = inside_ ? drawn_.draw(window(inside_->colour), window(inside_->depth))
                               : drawn_.draw(window_of(picture), window_of(pictures[1]));
    return ViewSet::borrow(views, shape_.aspect);
  }

 private:
  std::optional<DepthWindows> inside_;
  DepthViews drawn_;
  ViewShape shape_;
};

class WovenForAnotherRig final : public ViewArrangement {
 public:
  WovenForAnotherRig(const optics::OpticalModel& model, int views) : model_(model), views_(views) {
    const optics::Panel& panel = model.rig().panel;
    const FrameGeometry view = decoded_geometry(model.rig());
    shape_ = shape_of(
        views, view.width, view.height,
        panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value));
  }
  ViewShape shape() const override { return shape_; }
  ViewSet arrange(std::span<const FrameView> pictures) override {
    return views_of_woven(pictures.front(), model_, views_);
  }

 private:
  optics::OpticalModel model_;
  int views_;
  ViewShape shape_;
};

}  // namespace

std::unique_ptr<ViewArrangement> arrange_quilt(const FrameGeometry& picture,
                                               const QuiltLayout& layout, bool rightmost_first,
                                               const std::string& name) {
  const TileSize tile = tile_size(picture, layout, name);
  return std::make_unique<Stored>(
      shape_of(layout.view_count(), tile.width, tile.height, layout.aspect), layout,
      rightmost_first);
}

std::unique_ptr<ViewArrangement> arrange_pictures(const FrameGeometry& picture, int count,
                                                  std::optional<double> aspect,
                                                  bool rightmost_first) {
  return std::make_unique<Stored>(shape_of(count, picture.width, picture.height, aspect),
                                  std::nullopt, rightmost_first);
}

std::unique_ptr<ViewArrangement> arrange_depth(const TileSize& colour,
                                               const std::optional<DepthWindows>& inside,
                                               std::optional<double> aspect,
                                               const DepthOptions& options) {
  return std::make_unique<ColourAndDepth>(colour, inside, aspect, options);
}

std::unique_ptr<ViewArrangement> arrange_woven(const FrameGeometry& picture,
                                               const optics::OpticalModel& woven_for, int views,
                                               const std::string& name) {
  const optics::Panel& panel = woven_for.rig().panel;
  if (picture != FrameGeometry{.width = panel.width_px, .height = panel.height_px})
    throw Error(ErrorKind::Input,
                fmt::format("{}: {}x{} pixels, but the panel of the rig that it was woven for has "
                            "{}x{}",
                            name, picture.width, picture.height, panel.width_px, panel.height_px),
                "use the rig that it was woven for");
  return std::make_unique<WovenForAnotherRig>(woven_for, views);
}

ViewInput::ViewInput(std::vector<std::unique_ptr<FrameSource>> pictures,
                     std::unique_ptr<ViewArrangement> arrangement, std::string name,
                     const ViewCrop& crop)
    : arrangement_(std::move(arrangement)),
      crop_(crop),
      name_(std::move(name)),
      shape_(arrangement_->shape()) {
  const TileSize part = cropped_size({.width = shape_.width, .height = shape_.height}, crop);
  shape_.aspect *= static_cast<double>(part.width) / shape_.width * shape_.height / part.height;
  shape_.width = part.width;
  shape_.height = part.height;
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

bool ViewInput::repeats() const {
  return std::ranges::all_of(
      streams_, [](const Stream& one) { return one.acquired && one.acquired->repeats; });
}

const ViewSet& ViewInput::views() {
  if (!views_) {
    std::vector<FrameView> pictures;
    pictures.reserve(streams_.size());
    for (const Stream& stream : streams_) pictures.push_back(stream.acquired->frame);
    views_ = arrangement_->arrange(pictures).cropped(crop_);
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
