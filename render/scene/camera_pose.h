// SPDX-License-Identifier: Apache-2.0
// What makes a camera's three vectors a pose.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// A unit vector at right angles to `v` (which is not zero).
[[nodiscard]] Vec3 any_perpendicular(Vec3 v);

/// False if `up` is zero or, to single precision, parallel to the viewing direction.
[[nodiscard]] bool up_is_usable(const Camera& camera);

}  // namespace lenticule::render
