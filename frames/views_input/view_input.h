// SPDX-License-Identifier: Apache-2.0
// ViewInput provides sets of views, one after the other: it combines the pictures of one or several
// sources with the arrangement of views in these pictures.
#pragma once

#include <poll.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "frames/frame.h"
#include "frames/frame_source.h"
#include "frames/quilt.h"
#include "frames/views_input/content_name.h"
#include "frames/views_input/depth_views.h"
#include "frames/weave.h"
#include "frames/weaving/reweave.h"
#include "frames/weaving/weave_plan.h"
#include "optics/model.h"

namespace lenticule::frames {

/// ViewArrangement finds the views of one moment in the pictures of that moment: tiles of one
/// picture, one picture per view, a picture and its depth, or micro-images for another rig.
///
/// ViewArrangement makes view sets whose view 0 belongs to the leftmost camera.
///
/// Thread safety: one thread.
struct ViewArrangement {
  ViewShape shape;  ///< shape of the views of all sets
  /// Arranges pictures of the sizes that the arrangement was made for. Throws at most
  /// std::bad_alloc.
  ///
  /// Lifetime: the set may refer to the pictures and to the arrangement, and is valid until either
  /// changes.
  std::function<ViewSet(std::span<const FrameView> pictures)> arrange;
};

/// Returns the shape; by default its pixels are square.
inline ViewShape shape_of(int count, int width, int height, std::optional<double> aspect) {
  return {.count = count,
          .width = width,
          .height = height,
          .aspect = aspect.value_or(static_cast<double>(width) / height)};
}

/// Takes views as the pictures hold them: tiles of one, or one per picture.
inline std::unique_ptr<ViewArrangement> arrange_stored(const ViewShape& shape,
                                                       const std::optional<QuiltLayout>& quilt,
                                                       bool rightmost_first) {
  const auto arrange = [=](std::span<const FrameView> pictures) {
    ViewSet views =
        quilt ? ViewSet::borrow(pictures.front(), *quilt) : ViewSet::borrow(pictures, shape.aspect);
    return rightmost_first ? std::move(views).reversed() : std::move(views);
  };
  return std::make_unique<ViewArrangement>(ViewArrangement{shape, arrange});
}

/// Arranges one picture of tiles, the first tile from the leftmost or the rightmost camera. Throws
/// the Error(Input) and Error(Usage) of tile_size(), with messages that begin with `name`.
[[nodiscard]] inline std::unique_ptr<ViewArrangement> arrange_quilt(const FrameGeometry& picture,
                                                                    const QuiltLayout& layout,
                                                                    bool rightmost_first,
                                                                    const std::string& name) {
  const TileSize tile = tile_size(picture, layout, name);
  return arrange_stored(shape_of(layout.view_count(), tile.width, tile.height, layout.aspect),
                        layout, rightmost_first);
}

/// Arranges `count` pictures of one size, from the leftmost camera to the rightmost or in reverse
/// order.
[[nodiscard]] inline std::unique_ptr<ViewArrangement> arrange_pictures(const FrameGeometry& picture,
                                                                       int count,
                                                                       std::optional<double> aspect,
                                                                       bool rightmost_first) {
  return arrange_stored(shape_of(count, picture.width, picture.height, aspect), std::nullopt,
                        rightmost_first);
}

/// Arranges two pictures, colours and depth of any size; or one picture that has both `inside`.
[[nodiscard]] inline std::unique_ptr<ViewArrangement> arrange_depth(
    const TileSize& colour, const std::optional<DepthWindows>& inside, std::optional<double> aspect,
    const DepthOptions& options) {
  const auto drawn = std::make_shared<DepthViews>(colour.width, colour.height, options);
  const ViewShape shape = shape_of(options.views, colour.width, colour.height, aspect);
  const auto arrange = [=](std::span<const FrameView> pictures) {
    const FrameView& picture = pictures.front();
    const auto window = [&](const DepthWindows::Window& part) {
      return PictureWindow{.pixels = picture.row(part.top) + static_cast<size_t>(part.left) * 3,
                           .stride_bytes = picture.geometry.row_bytes(),
                           .width = part.size.width,
                           .height = part.size.height};
    };
    const auto views = inside ? drawn->draw(window(inside->colour), window(inside->depth))
                              : drawn->draw(window_of(picture), window_of(pictures[1]));
    return ViewSet::borrow(views, shape.aspect);
  };
  return std::make_unique<ViewArrangement>(ViewArrangement{shape, arrange});
}

/// Arranges a frame woven for another rig: decodes it into `views` views. Slow.
[[nodiscard]] inline std::unique_ptr<ViewArrangement> arrange_woven(
    const FrameGeometry& picture, const optics::OpticalModel& woven_for, int views,
    const std::string& name) {
  const optics::Panel& panel = woven_for.rig().panel;
  if (picture != FrameGeometry{.width = panel.width_px, .height = panel.height_px})
    throw input_error("{}: {}x{} pixels, but the panel of the rig that it was woven for has {}x{}",
                      name, picture.width, picture.height, panel.width_px, panel.height_px)
        .remedy("use the rig that it was woven for");
  const FrameGeometry view = decoded_geometry(woven_for.rig());
  const ViewShape shape = shape_of(
      views, view.width, view.height,
      panel.width_px * panel.pixel_width.value / (panel.height_px * panel.pixel_height.value));
  return std::make_unique<ViewArrangement>(
      ViewArrangement{shape, [woven_for, views](std::span<const FrameView> pictures) {
                        return views_of_woven(pictures.front(), woven_for, views);
                      }});
}

/// ViewInput pulls pictures and arranges them.
///
/// Thread safety: one thread.
class ViewInput {
 public:
  /// Takes one picture of each source at a time. Throws Error(Input) if the sources state different
  /// numbers of frames, Error(Usage) as cropped_size() does.
  ViewInput(std::vector<std::unique_ptr<FrameSource>> pictures,
            std::unique_ptr<ViewArrangement> arrangement, std::string name,
            const ViewCrop& crop = {})
      : arrangement_(std::move(arrangement)),
        crop_(crop),
        name_(std::move(name)),
        shape_(arrangement_->shape) {
    const TileSize part = cropped_size({.width = shape_.width, .height = shape_.height}, crop);
    shape_.aspect *= static_cast<double>(part.width) / shape_.width * shape_.height / part.height;
    shape_.width = part.width;
    shape_.height = part.height;
    LENTICULE_CHECK(!pictures.empty());
    for (auto& source : pictures) streams_.push_back({.source = std::move(source)});
    const std::optional<uint64_t> frames = streams_.front().source->frame_count();
    for (const Stream& stream : streams_)
      if (const auto others = stream.source->frame_count(); frames && others && frames != others)
        throw input_error("{}: one part has {} frames, another {}", name_, *frames, *others)
            .remedy("every part needs a picture for each frame");
  }
  /// Provides the same views once per round.
  explicit ViewInput(ViewSet still)
      : shape_(shape_of(still)), views_(std::move(still)), still_(true) {}
  ~ViewInput() { release(); }

  [[nodiscard]] const ViewShape& shape() const { return shape_; }
  [[nodiscard]] std::optional<Rate> rate() const {
    return still_ ? std::nullopt : streams_.front().source->rate();
  }
  /// Returns the number of frames of one round, if known.
  [[nodiscard]] std::optional<uint64_t> frame_count() const {
    return still_ ? std::optional<uint64_t>(1) : streams_.front().source->frame_count();
  }

  /// Pulls the pictures of the next set, after the last one was released. Never waits for a disk or
  /// a decoder.
  [[nodiscard]] PullStatus next() {
    if (!failure_.empty()) return PullStatus::Failed;
    if (still_) return std::exchange(still_given_, true) ? PullStatus::End : PullStatus::Ready;
    const PullStatus status = pull_all();
    if (status == PullStatus::Ready) number_ = streams_.front().acquired->number;
    return status;
  }
  /// Returns the views in the pictures of next(), valid until release(). The first call for a set
  /// may take long if views are drawn. Throws the errors of the arrangement.
  [[nodiscard]] const ViewSet& views() {
    if (!views_) {
      std::vector<FrameView> pictures;
      pictures.reserve(streams_.size());
      for (const Stream& stream : streams_) pictures.push_back(stream.acquired->frame);
      views_ = arrangement_->arrange(pictures).cropped(crop_);
    }
    return *views_;
  }
  [[nodiscard]] uint64_t number() const { return number_; }
  /// Returns the time of capture of the pictures of next(), as AcquiredFrame does.
  [[nodiscard]] int64_t captured_ns() const {
    return still_ ? 0 : streams_.front().acquired->captured_ns;
  }
  /// Returns true if the pictures of next() are those of the set before.
  [[nodiscard]] bool repeats() const {
    return std::ranges::all_of(
        streams_, [](const Stream& one) { return one.acquired && one.acquired->repeats; });
  }
  void release() {
    if (still_) return;
    views_.reset();
    for (Stream& stream : streams_)
      if (const auto acquired = std::exchange(stream.acquired, std::nullopt))
        stream.source->release(acquired->token);
  }

  /// Restarts from the beginning, after End. Returns false if that is not possible.
  [[nodiscard]] bool rewind() {
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
  /// Goes on after End with what another renderer sends.
  void go_on() {
    for (Stream& stream : streams_) stream.ended = false;
  }
  /// Waits until next() may have more, but at most `longest`.
  void wait(std::chrono::milliseconds longest) {
    std::vector<pollfd> wakes;
    for (const Stream& stream : streams_)
      if (!stream.acquired && !stream.ended && stream.source->wake_fd() >= 0)
        wakes.push_back({.fd = stream.source->wake_fd(), .events = POLLIN, .revents = 0});
    (void)poll(wakes.data(), wakes.size(), static_cast<int>(longest.count()));
    for (Stream& stream : streams_) stream.source->service();
  }
  [[nodiscard]] const std::string& failure() const { return failure_; }
  /// Returns the damage of all sources together, so far.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] FrameDamage damage() const {
    FrameDamage sum;
    for (const Stream& stream : streams_) sum += stream.source->damage();
    return sum;
  }
  /// Returns that of the first source that has one, as FrameSource does.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] std::string video_decoder() const {
    for (const Stream& stream : streams_)
      if (std::string name = stream.source->video_decoder(); !name.empty()) return name;
    return {};
  }

 private:
  struct Stream {
    std::unique_ptr<FrameSource> source;
    std::optional<AcquiredFrame> acquired = std::nullopt;
    bool ended = false;
  };
  [[nodiscard]] PullStatus pull_all() {
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
  [[nodiscard]] PullStatus fail(std::string why) {
    failure_ = std::move(why);
    return PullStatus::Failed;
  }

  std::vector<Stream> streams_;
  std::unique_ptr<ViewArrangement> arrangement_;
  ViewCrop crop_;
  std::string name_;
  ViewShape shape_;
  std::optional<ViewSet> views_;
  bool still_ = false;
  bool still_given_ = false;
  uint64_t number_ = 0;
  std::string failure_;
};

}  // namespace lenticule::frames
