// SPDX-License-Identifier: Apache-2.0
// Martin Newell's teapot of 1975, from the control points of its 32 bicubic Bezier patches.
#pragma once

#include <vector>

#include "scenes/elements.h"

namespace lenticule::scenes {

/// Returns the teapot with z up, standing on z = 0, spout toward +x: x in [-3, 3.434], |y| <= 2, z
/// in [0, 3.15]. Each patch is divided `size` times in each direction: 64 size^2 - 8 size
/// triangles, counter-clockwise seen from outside, with the surface's exact unit normals. Patches
/// that share an edge share its points exactly.
[[nodiscard]] std::vector<SurfaceTriangle> teapot_triangles(int size);

}  // namespace lenticule::scenes
