// SPDX-License-Identifier: Apache-2.0
// Chooses the look-at point of cameras from files, which state a direction but no distance.
#pragma once

#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Returns true if the numbers are finite and state a view.
[[nodiscard]] bool is_usable(const Camera& camera);

/// Moves `at` along the view to the depth of the middle of `bounds`, the bounds of the scene, where
/// the panel will be.
void focus(Camera& camera, const SceneDescription& scene, const Bounds& bounds);

}  // namespace lenticule::render
