// SPDX-License-Identifier: Apache-2.0
// Helpers that complete a camera's viewing direction and up vector to a pose.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Returns a unit vector perpendicular to `v`, which must not be zero.
[[nodiscard]] Vec3 any_perpendicular(Vec3 v);

/// Returns false if `up` is zero or, in single precision, parallel to the viewing direction.
[[nodiscard]] bool up_is_usable(const Camera& camera);

}  // namespace lenticule::render
