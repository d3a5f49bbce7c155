// SPDX-License-Identifier: Apache-2.0
// Tells the subject of a scene from its setting: floors, walls and backdrops. The depth of a scene
// is fitted to the subject (make_stage), because a floor is often many times as deep as the model
// on it, and would flatten it; and a floor loses least where it is blurred.
//
// Files do not say what is a floor, so the picture decides. A depth buffer of the triangles that
// the viewer sees tells in which plane each of its samples lies. A plane is part of the setting if
//   - it covers at least a twentieth of the samples, and
//   - nearly all others lie on the viewer's side of it: things stand on a floor and before a wall,
//     while a convex model, such as a box, lies behind each of its visible faces.
// The subject is all geometry, seen or not, that comes before all of these planes: so a model that
// is small on its floor is found, and is fitted as it would be without the floor.
//
// Hilly ground is not found, and of curved backdrops only the flat parts are. The result does not
// depend on how a surface is cut into triangles.
#pragma once

#include <optional>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// PictureView is a rectangle around `centre` as seen from `eye`. World units.
struct PictureView {
  Vec3 eye, centre;
  Vec3 right, up;        ///< from the centre to the border; perpendicular, also to centre - eye
  double nearest = 0.0;  ///< distance along the view from which on content is seen
  Vec3 turns_about{};    ///< axis of a scene that turns, of which only floors are the setting
};

/// Returns the geometry of the subject, without materials, or nothing if there is no setting. The
/// scene's nodes must be evaluated.
[[nodiscard]] std::optional<SceneDescription> subject_of(const SceneDescription& scene,
                                                         const PictureView& view);

}  // namespace lenticule::render
