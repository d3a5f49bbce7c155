// SPDX-License-Identifier: Apache-2.0
// The stage: how a scene is put before, on and behind the glass.
#pragma once

#include <optional>

#include "optics/model.h"
#include "optics/vec.h"
#include "render/scene_description.h"

namespace lenticule::render {

/// What a user may say; what is left out is chosen so that the scene's centre lies on the glass and
/// its depth fits the budget.
struct StageOptions {
  std::optional<Vec3> centre;          ///< world point that lies at the panel's centre on the glass
  std::optional<double> mm_per_unit;   ///< size on the glass
  /// Depth scale relative to mm_per_unit: 1 = undistorted, 0.5 = half as deep. Left out: 1, or less
  /// where the scene would leave the depth budget.
  std::optional<double> depth_scale;
  /// How far content may leave the glass, in units of the sheet's depth of field.
  double depth_budget = 1.0;
  /// Part of the panel's height and width that the scene may fill when it is fitted.
  double fill = 0.9;
  /// Turn of the scene about the panel's vertical axis, degrees.
  double turn_degrees = 0.0;
};

struct Stage {
  Affine panel_from_world;  ///< mm from world units; linear part = depth scale * rotation * scale
  Affine world_from_panel;
  double mm_per_unit = 1.0;
  double depth_scale = 1.0;
  double near_mm = 0.0;  ///< scene bounds in the panel frame: z of the nearest and farthest point
  double far_mm = 0.0;
  double depth_of_field_mm = 0.0;  ///< of the rig
};

/// World-space bounds of everything that can be seen (infinite planes excepted).
struct Bounds {
  Vec3 low{1, 1, 1};
  Vec3 high{-1, -1, -1};
  [[nodiscard]] bool empty() const { return !(low.x <= high.x); }
  void extend(Vec3 p);
};
[[nodiscard]] Bounds scene_bounds(const SceneDescription& scene);

/// Orientation comes from the scene's first camera if it has one (its view direction goes into the
/// glass, its up is up), else the world's y is up and its z toward the viewer. With a camera, the
/// point it looks at lies on the glass and its picture fills the panel as its field of view says.
/// Throws Error(Input) for a scene with nothing in it.
[[nodiscard]] Stage make_stage(const SceneDescription& scene, const optics::OpticalModel& model,
                               const StageOptions& options = {});

}  // namespace lenticule::render
