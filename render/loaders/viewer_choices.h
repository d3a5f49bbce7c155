// SPDX-License-Identifier: Apache-2.0
// Completes what scene files leave to the viewer: the exposure, the points that cameras look at,
// and the metallic-roughness materials that stand for others.
#pragma once

#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Scales all lights by a common factor, light_scale, so that they light the centre of the scene
/// well. Files use candela, watts or arbitrary units, and leave the exposure to the viewer.
void expose(SceneDescription& scene);

/// Returns true if the numbers are finite and state a view.
[[nodiscard]] bool is_usable(const Camera& camera);

/// Moves `at` along the view to the depth of the middle of `bounds`, the bounds of the scene, where
/// the panel will be.
void focus(Camera& camera, const SceneDescription& scene, const Box& bounds);

/// Returns the metallic-roughness material that is most like a Whitted one.
[[nodiscard]] PbrMaterial pbr_like(const Material& material);

}  // namespace lenticule::render
