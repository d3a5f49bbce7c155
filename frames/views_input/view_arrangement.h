// SPDX-License-Identifier: Apache-2.0
// ViewArrangement finds the views of one moment in the pictures of that moment: tiles of one
// picture, one picture per view, a picture and its depth, or micro-images for another rig.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "frames/frame.h"
#include "frames/quilt.h"
#include "frames/views_input/content_name.h"
#include "frames/views_input/depth_views.h"
#include "frames/weaving/weave_plan.h"
#include "optics/model.h"

namespace lenticule::frames {

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

/// Arranges two pictures: colours, and depth of any size.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_depth(const FrameGeometry& colour,
                                                             std::optional<double> aspect,
                                                             const DepthOptions& options);
/// Arranges one picture, half of which is depth. Throws Error(Input) for less than two pixels.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_depth_in(const FrameGeometry& picture,
                                                                DepthPlace place,
                                                                std::optional<double> aspect,
                                                                const DepthOptions& options,
                                                                const std::string& name);

/// Arranges a frame woven for another rig: decodes it into `views` views. Slow.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_woven(const FrameGeometry& picture,
                                                             const optics::OpticalModel& woven_for,
                                                             int views, const std::string& name);

}  // namespace lenticule::frames
