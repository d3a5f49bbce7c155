// SPDX-License-Identifier: Apache-2.0
// The stage: how a scene is put before, on and behind the glass.
#pragma once

#include <optional>

#include "optics/model.h"
#include "optics/vec.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

/// What a user may say; what is left out is chosen so that the scene's centre lies on the glass and
/// its depth fits the budget.
struct StageOptions {
  std::optional<Vec3> centre{};  ///< world point that lies at the panel's centre on the glass
  std::optional<double> mm_per_unit{};  ///< size on the glass
  /// Depth scale relative to mm_per_unit: 1 = undistorted, 0.5 = half as deep. Left out: 1, or less
  /// where the scene would leave the depth budget.
  std::optional<double> depth_scale{};
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
  /// z in the panel frame of the nearest thing to be shown: the front of the scene's bounds, but
  /// never in front of the plane where its camera starts to see (a room's wall behind the camera is
  /// not shown). Rays start here.
  double near_mm = 0.0;
  double far_mm = 0.0;             ///< z of the back of the scene's bounds
  double depth_of_field_mm = 0.0;  ///< of the rig; infinite for a sheet without a gap
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
/// point it looks at lies on the glass and the square that its vertical field of view spans there
/// fills the panel's shorter side. Without one, the bounds are centred on the glass and fitted.
///
/// The depth budget is held by what the camera sees up to three times the distance of the point it
/// looks at (a ground that runs to the horizon does not flatten the scene), without a camera by
/// everything; nothing comes nearer than half the way to the eye. Nodes are taken at time 0.
/// Throws Error(Input) for a scene with nothing in it or without an extent, Error(Usage) for
/// options that make no sense.
[[nodiscard]] Stage make_stage(const SceneDescription& scene, const optics::OpticalModel& model,
                               const StageOptions& options = {});

}  // namespace lenticule::render
