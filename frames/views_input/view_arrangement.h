// SPDX-License-Identifier: Apache-2.0
// How the views of one moment lie in the pictures of that moment: tiles of one, a picture each, a
// picture and its depth, or under the lenses of another rig.
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

/// One thread. Whatever comes out has view 0 from the leftmost camera.
class ViewArrangement {
 public:
  virtual ~ViewArrangement() = default;
  /// Of all sets.
  [[nodiscard]] virtual ViewShape shape() const = 0;
  /// Pictures of the sizes that the arrangement was made for. The set may refer to them and to the
  /// arrangement: it is good until either changes. Throws std::bad_alloc at most.
  [[nodiscard]] virtual ViewSet arrange(std::span<const FrameView> pictures) = 0;
};

/// One picture of tiles, the first of them from the leftmost or the rightmost camera. Throws
/// Error(Input) and Error(Usage) as tile_size() does, their messages beginning with `name`.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_quilt(const FrameGeometry& picture,
                                                             const QuiltLayout& layout,
                                                             bool rightmost_first,
                                                             const std::string& name);

/// `count` pictures of one size, from the leftmost camera to the rightmost, or the other way round.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_pictures(const FrameGeometry& picture,
                                                                int count,
                                                                std::optional<double> aspect,
                                                                bool rightmost_first);

/// Two pictures: colours, and depth of any size.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_depth(const FrameGeometry& colour,
                                                             std::optional<double> aspect,
                                                             const DepthOptions& options);
/// One picture, a half of which is depth. Throws Error(Input) for less than two pixels.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_depth_in(const FrameGeometry& picture,
                                                                DepthPlace place,
                                                                std::optional<double> aspect,
                                                                const DepthOptions& options,
                                                                const std::string& name);

/// A frame that was woven for another rig, taken apart into so many views. Slow.
[[nodiscard]] std::unique_ptr<ViewArrangement> arrange_woven(const FrameGeometry& picture,
                                                             const optics::OpticalModel& woven_for,
                                                             int views, const std::string& name);

}  // namespace lenticule::frames
