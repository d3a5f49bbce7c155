// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-tools/offline/convert_input.h"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "base/error.h"
#include "frames/sequence/sequence_reader.h"
#include "frames/weaving/quilt_file.h"
#include "player/process/interrupt.h"

namespace lenticule::tools {
namespace {

using frames::PullStatus;

constexpr std::chrono::milliseconds kLook{100};
constexpr std::chrono::minutes kTimeout{2};

class ContainerInput final : public ConvertInput {
 public:
  explicit ContainerInput(const std::string& file)
      : reader_(file), decoder_(reader_.make_decoder()) {
    if (reader_.frame_count() == 0)
      throw Error(ErrorKind::Input, fmt::format("{}: has no frames", file));
  }

  std::optional<uint64_t> count() const override { return reader_.frame_count(); }
  frames::SequenceInfo info() const override { return reader_.info(); }
  ReadResult read(uint64_t number, frames::WovenFrame& frame) override {
    if (number >= reader_.frame_count()) return ReadResult::End;
    return decoder_.decode(number, frame.bytes()) ? ReadResult::Ok : ReadResult::Damaged;
  }

 private:
  frames::SequenceReader reader_;
  frames::FrameDecoder decoder_;
};

class ViewFrames final : public ConvertInput {
 public:
  ViewFrames(std::unique_ptr<frames::ViewInput> views, FramesOfViews frames, std::string name)
      : views_(std::move(views)), frames_(std::move(frames)), name_(std::move(name)) {}

  std::optional<uint64_t> count() const override { return views_->frame_count(); }
  frames::SequenceInfo info() const override {
    frames::SequenceInfo info;
    info.geometry = frames_.geometry;
    if (const auto rate = views_->rate()) info.rate = *rate;
    return info;
  }
  ReadResult read(uint64_t number, frames::WovenFrame& frame) override {
    if (!advance_to(number)) return ReadResult::End;
    if (frames_.pipeline)
      frames_.pipeline->weave(views_->views(), frame);
    else
      frames::draw_quilt(views_->views(), frames_.layout, frame);
    views_->release();
    return ReadResult::Ok;
  }

  frames::FrameDamage damage() const override { return views_->damage(); }

 private:
  /// Skips frames up to the requested one; returns false at the end.
  bool advance_to(uint64_t number) {
    auto deadline = std::chrono::steady_clock::now() + kTimeout;
    while (std::chrono::steady_clock::now() < deadline) {
      const PullStatus status = views_->next();
      if (status == PullStatus::End) return false;
      if (status == PullStatus::Failed) throw Error(ErrorKind::Input, views_->failure());
      if (status == PullStatus::NotYet) {
        if (player::interrupted()) return false;
        views_->wait(kLook);
        continue;
      }
      if (views_->number() >= number) return true;
      views_->release();
      deadline = std::chrono::steady_clock::now() + kTimeout;
    }
    throw Error(ErrorKind::Failed, fmt::format("{}: no picture arrived", name_));
  }

  std::unique_ptr<frames::ViewInput> views_;
  FramesOfViews frames_;
  std::string name_;
};

}  // namespace

std::unique_ptr<ConvertInput> open_container_input(const std::string& file) {
  return std::make_unique<ContainerInput>(file);
}

/// Opens woven pictures; each is read as a quilt of one tile.
std::unique_ptr<ConvertInput> open_woven_input(const std::string& text,
                                               const player::PictureOptions& options) {
  std::vector<std::unique_ptr<frames::FrameSource>> sources;
  sources.push_back(open_pictures(text, options));
  const frames::FrameGeometry geometry = sources.front()->geometry();
  auto arrangement = frames::arrange_pictures(geometry, 1, std::nullopt, false);
  auto views =
      std::make_unique<frames::ViewInput>(std::move(sources), std::move(arrangement), text);
  return make_view_input(std::move(views),
                         {.pipeline = nullptr, .geometry = geometry, .layout = {}}, text);
}

std::unique_ptr<ConvertInput> make_view_input(std::unique_ptr<frames::ViewInput> views,
                                              FramesOfViews frames, const std::string& name) {
  return std::make_unique<ViewFrames>(std::move(views), std::move(frames), name);
}

}  // namespace lenticule::tools
