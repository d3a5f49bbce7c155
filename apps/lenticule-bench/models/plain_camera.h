// SPDX-License-Identifier: Apache-2.0
// Renders models as a plain camera sees them, so that the picture can be compared with that of
// another renderer: a rig with one lens per pixel, whose lenses all look at the same eye.
#pragma once

#include "optics/rig.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::bench {

/// Vertical field of view of framing_camera().
inline constexpr double kModelFovDegrees = 30.0;

/// Returns a square rig whose subpixels send their rays through one eye. Seen from there each lens
/// shows the centre of its pixel, where all three channels lie, and the panel spans
/// `vertical_fov_degrees`.
[[nodiscard]] optics::Rig plain_camera_rig(int side_px, double vertical_fov_degrees);

/// Returns the direction from a model to framing_camera(): in front, to the right and above, in
/// glTF's axes (y up, +z in front).
[[nodiscard]] Vec3 toward_framing_camera();
/// Returns the horizontal direction from that camera past the model, where the renderer puts the
/// middle of an environment picture.
[[nodiscard]] Vec3 environment_ahead();
/// Returns the camera that looks at the middle of the scene's bounds and sees its meshes as large
/// as possible, with a margin, in a square picture. The scene has no nodes. Throws Error(Input) for
/// a scene without meshes or extent.
[[nodiscard]] render::Camera framing_camera(const render::SceneDescription& scene);

/// Returns the placement that puts the camera at the rig's eye and leaves depth undistorted. The
/// camera must have the field of view of the rig.
[[nodiscard]] render::StageOptions plain_camera_stage(const render::Camera& camera,
                                                      const optics::Rig& rig);

}  // namespace lenticule::bench
