// SPDX-License-Identifier: Apache-2.0
// Cuts planar polygons, concave ones too, into triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

/// Twice the area times the unit normal of a closed polygon (Newell's sum). Taken about the first
/// corner, so that far-away polygons keep their digits.
[[nodiscard]] Vec3 polygon_area_vector(std::span<const Vec3> corners);

struct Triangulation {
  std::vector<std::array<uint32_t, 3>> triangles;  ///< indices into the corners, same turn
  /// False where the outline crosses itself: the triangles then cover it only roughly.
  bool simple = true;
};

/// Ear clipping in the polygon's own plane; a polygon with an area gives size - 2 triangles, less
/// the corners that are straight or coincide with their neighbour. One without an area gives none.
/// Repeated corners (a hole joined to the outline by a double edge) are fine. Time: linear for
/// convex polygons, at most the number of corners times the number of concave ones otherwise.
[[nodiscard]] Triangulation triangulate(std::span<const Vec3> corners);

}  // namespace lenticule::render
