// SPDX-License-Identifier: Apache-2.0
// ViewInput provides sets of views, one after the other: it combines the pictures of one or several
// sources with the arrangement of views in these pictures.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "frames/frame_source.h"
#include "frames/quilt.h"
#include "frames/views_input/content_name.h"
#include "frames/views_input/depth_views.h"
#include "frames/weaving/weave_plan.h"
#include "optics/model.h"

namespace lenticule::frames {

/// ViewArrangement finds the views of one moment in the pictures of that moment: tiles of one
/// picture, one picture per view, a picture and its depth, or micro-images for another rig.
///
/// ViewArrangement makes view sets whose view 0 belongs to the leftmost camera.
///
/// Thread safety: one thread.
class ViewArrangement {
 public:
  virtual ~ViewArrangement() = default;
  /// Returns the shape of all sets.
  [[nodiscard]] virtual ViewShape shape() const = 0;
  /// Arranges pictures of the sizes that the arrangement was made for. Throws at most
  /// std::bad_alloc.
  ///
  /// Lifetime: the set may refer to the pictures and to the arrangement, and is valid until either
  /// changes.
  [[nodiscard]] virtual ViewSet arrange(std::span<const FrameView> pictures) = 0;
};

/// Arranges one picture of tiles, the first tile from the leftmost or the rightmost camera. Throws
/// the Error(Input) and Error(Usage) of tile_size(), with messages that begin with `name`.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_quilt(const FrameGeometry& picture,
                                                             const QuiltLayout& layout,
                                                             bool rightmost_first,
                                                             const std::string& name);

/// Arranges `count` pictures of one size, from the leftmost camera to the rightmost or in reverse
/// order.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_pictures(const FrameGeometry& picture,
                                                                int count,
                                                                std::optional<double> aspect,
                                                                bool rightmost_first);

/// Arranges two pictures, colours and depth of any size; or one picture that has both `inside`.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_depth(
    const TileSize& colour, const std::optional<DepthWindows>& inside, std::optional<double> aspect,
    const DepthOptions& options);

/// Arranges a frame woven for another rig: decodes it into `views` views. Slow.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_woven(const FrameGeometry& picture,
                                                             const optics::OpticalModel& woven_for,
                                                             int views, const std::string& name);

/// ViewInput pulls pictures and arranges them.
///
/// Thread safety: one thread.
class ViewInput {
 public:
  /// Takes one picture of each source at a time. Throws Error(Input) if the sources state different
  /// numbers of frames, Error(Usage) as cropped_size() does.
  ViewInput(std::vector<std::unique_ptr<FrameSource>> pictures,
            std::unique_ptr<ViewArrangement> arrangement, std::string name,
            const ViewCrop& crop = {});
  /// Provides the same views once per round.
  explicit ViewInput(ViewSet still);
  ~ViewInput();
  ViewInput(const ViewInput&) = delete;
  ViewInput& operator=(const ViewInput&) = delete;

  [[nodiscard]] const ViewShape& shape() const { return shape_; }
  [[nodiscard]] std::optional<Rate> rate() const;
  /// Returns the number of frames of one round, if known.
  [[nodiscard]] std::optional<uint64_t> frame_count() const;

  /// Pulls the pictures of the next set, after the last one was released. Never waits for a disk or
  /// a decoder.
  [[nodiscard]] PullStatus next();
  /// Returns the views in the pictures of next(), valid until release(). The first call for a set
  /// may take long if views are drawn. Throws the errors of the arrangement.
  [[nodiscard]] const ViewSet& views();
  [[nodiscard]] uint64_t number() const { return number_; }
  /// Returns true if the pictures of next() are those of the set before.
  [[nodiscard]] bool repeats() const;
  void release();

  /// Restarts from the beginning, after End. Returns false if that is not possible.
  [[nodiscard]] bool rewind();
  /// Waits until next() may have more, but at most `longest`.
  void wait(std::chrono::milliseconds longest);
  [[nodiscard]] const std::string& failure() const { return failure_; }
  /// Returns the damage of all sources together, so far.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] FrameDamage damage() const;
  /// Returns that of the first source that has one, as FrameSource does.
  ///
  /// Thread safety: any thread.
  [[nodiscard]] std::string video_decoder() const;

 private:
  struct Stream {
    std::unique_ptr<FrameSource> source;
    std::optional<AcquiredFrame> acquired = std::nullopt;
    bool ended = false;
  };
  [[nodiscard]] PullStatus pull_all();
  [[nodiscard]] PullStatus fail(std::string why);

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
