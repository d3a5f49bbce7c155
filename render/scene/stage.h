// SPDX-License-Identifier: Apache-2.0
// Stage places a scene in front of, on and behind the panel, or the panels of a wall.
#pragma once

#include <optional>
#include <string>

#include "base/interval.h"
#include "optics/model.h"
#include "optics/vec.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Returns a unit vector perpendicular to `v`, which must not be zero.
[[nodiscard]] Vec3 any_perpendicular(Vec3 v);

/// Returns false if `up` is zero or, in single precision, parallel to the viewing direction.
[[nodiscard]] bool up_is_usable(const Camera& camera);

/// StageOptions holds the user's placement options. Defaults place the scene's centre on the panel
/// and make its depth fit the budget.
struct StageOptions {
  std::optional<Vec3> centre{};         ///< world point that is placed at the centre of the panel
  std::optional<double> mm_per_unit{};  ///< size on the panel
  /// Depth scale relative to mm_per_unit: 1 = undistorted, 0.5 = half as deep. Default: 1, or less
  /// if the scene would exceed the depth budget.
  std::optional<double> depth_scale{};
  /// Largest distance of content from the panel, in units of the sheet's depth of field.
  double depth_budget = 1.0;
  /// If true, a floor, walls and a backdrop must stay within the depth budget, too.
  bool whole_depth = false;
  /// Fraction of the panel's height and width that a fitted scene may fill.
  double fill = 0.9;
  /// Rotation of the scene about its vertical axis, degrees.
  double turn_degrees = 0.0;
  /// Angle from which the scene is seen from above, degrees in -90..90; with a camera it adds to
  /// the camera's. Default: kPitchWithoutCamera without a camera, else 0.
  std::optional<double> pitch_degrees{};
  /// If true, size and depth scale are those at which the scene fits at every turn.
  bool fit_every_turn = false;
  /// If true, the scene's cameras are ignored.
  bool ignore_cameras = false;
  /// Bounds of the content: if they are given, the content fills them.
  std::optional<Box> bounds{};
};

/// A scene without a camera is seen slightly from above, so that grounds are seen as planes.
inline constexpr double kPitchWithoutCamera = 12.0;

/// Returns the camera that places the scene, or null if there is none.
[[nodiscard]] inline const Camera* placing_camera(const SceneDescription& scene,
                                                  const StageOptions& options) {
  if (scene.cameras.empty() || options.ignore_cameras) return nullptr;
  return &scene.cameras.at(static_cast<size_t>(scene.camera));
}

/// Ground is the level plane that a model stands on, through its lowest point. World y is up, as
/// the loaders turn models. World units.
struct Ground {
  double y = 0.0;
  /// Geometric mean of the sides of the model's bounds; at least a quarter and at most twice the
  /// longer side of their base. 0 if they have no base.
  double size = 0.0;
  friend bool operator==(const Ground&, const Ground&) = default;
};

/// Canvas is the rectangle on which a scene is placed: a panel, or all panels of a wall together.
/// It lies in the plane z = 0 around the origin of its frame.
struct Canvas {
  double width_mm = 0.0;
  double height_mm = 0.0;
  double depth_of_field_mm = 0.0;    ///< the smallest of its panels
  double viewing_distance_mm = 0.0;  ///< may be infinite
};
[[nodiscard]] Canvas canvas_of(const optics::OpticalModel& model);

struct Stage {
  Affine panel_from_world;  ///< mm from world units; linear part = depth scale * rotation * scale
  Affine world_from_panel;
  double mm_per_unit = 1.0;
  double depth_scale = 1.0;
  /// Panel z of the nearest displayed content: the front of the scene's bounds, but never in front
  /// of the plane where its camera starts to see (a wall behind the camera is not displayed). Rays
  /// start here.
  double near_mm = 0.0;
  /// True if near_mm cuts off content, such as a wall behind the scene's camera.
  bool cuts_in_front = false;
  double far_mm = 0.0;    ///< panel z of the back of the scene's bounds
  Interval subject_mm{};  ///< panel z of the subject if the depth is fitted to it, otherwise empty
  double depth_of_field_mm = 0.0;  ///< the rig's; infinite for a sheet without a gap
  /// Ground of another moment of an animation, so that the ground does not move with the scene.
  /// Default: that of the scene.
  std::optional<Ground> ground{};
  /// Place of the panel on the canvas, by a rotation and a translation in millimetres. Identity for
  /// a panel that is not part of a wall.
  Affine canvas_from_panel{};
};

/// Returns the map from the canvas to the world. Light and backdrop depend on it, so that they are
/// the same on all panels of a wall.
[[nodiscard]] Affine world_from_canvas(const Stage& stage);

/// Returns the world direction of `canvas_direction`, whose components are along the canvas's axes,
/// as a unit vector. It does not depend on the depth scale.
[[nodiscard]] Vec3 world_direction(const Stage& stage, Vec3 canvas_direction);

/// Returns the stage of one panel of a wall from the stage of its canvas. A panel may be turned
/// unless the stage cuts off content in front: the plane of the cut would not be parallel to the
/// panel. Then throws Error(Input) that begins with `panel`, the panel's name.
[[nodiscard]] Stage stage_of_panel(const Stage& canvas, const Affine& canvas_from_panel,
                                   const std::string& panel);

/// Returns the world-space bounds of all visible content (infinite planes excepted).
[[nodiscard]] Box scene_bounds(const SceneDescription& scene);

/// Returns the ground of a model with these bounds, which must not be empty.
[[nodiscard]] Ground ground_under(const Box& bounds);

/// Computes the placement of a scene. The orientation comes from the scene's first camera if it has
/// one (its view direction points into the panel, its up vector is up); otherwise world y is up,
/// world z points to the viewer, and the viewer looks down by kPitchWithoutCamera. With a camera,
/// the point that it looks at lies on the panel, and the square that its vertical field of view
/// spans at that point fills the panel's shorter side. Without a camera, the middle of the bounds
/// lies at the centre of the panel, and the content is scaled to fit.
///
/// With a camera, the depth budget applies to the content that the camera sees up to three times
/// the distance of the point that it looks at (so a ground that extends to the horizon does not
/// flatten the scene). Without a camera it applies to all content. If the scene is clearly deeper
/// without its floor, walls and backdrop, it applies to the rest, the subject; they may come before
/// the panel by four budgets, and recede without limit. No content comes nearer than half the
/// distance from the panel to the eye. Nodes are evaluated at time 0.
/// Throws Error(Input) for a scene that is empty or has no extent, Error(Usage) for invalid
/// options.
[[nodiscard]] Stage make_stage(const SceneDescription& scene, const Canvas& canvas,
                               const StageOptions& options = {});
[[nodiscard]] inline Stage make_stage(const SceneDescription& scene,
                                      const optics::OpticalModel& model,
                                      const StageOptions& options = {}) {
  return make_stage(scene, canvas_of(model), options);
}

/// Throws Error(Input) "source: nothing to see in this scene: reasons". Call it for a scene without
/// content; `scene.notes` should say what the loader has left out or dropped.
[[noreturn]] void refuse_empty(const SceneDescription& scene);

/// InView is what the rays of a panel can meet of a scene: nothing, if all of it lies beside them
/// or in front of stage.near_mm; nothing but single-sided surfaces that face away; or more.
enum class InView { Nothing, BackFaces, Content };
/// Nodes must be evaluated.
[[nodiscard]] InView content_in_view(const SceneDescription& scene, const Stage& stage,
                                     const optics::OpticalModel& model);

/// Makes all surfaces visible from both sides; and the note that says so.
void show_both_sides(SceneDescription& scene);
inline constexpr const char* kBothSides =
    "all surfaces in view are single-sided and face away from the viewer; both sides are shown";

}  // namespace lenticule::render
