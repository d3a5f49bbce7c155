// SPDX-License-Identifier: Apache-2.0
// Triangulates planar polygons, including concave ones.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

/// Returns twice the area times the unit normal of a closed polygon (Newell's sum), computed
/// relative to the first corner, so that polygons far from the origin keep precision.
[[nodiscard]] Vec3 polygon_area_vector(std::span<const Vec3> corners);

struct Triangulation {
  std::vector<std::array<uint32_t, 3>> triangles;  ///< indices of the corners, same orientation
  /// False if the outline crosses itself: then the triangles cover it only approximately.
  bool simple = true;
};

/// Triangulates by ear clipping in the polygon's own plane. A polygon with an area gives size - 2
/// triangles, minus one for each corner that is straight or coincides with its neighbour; a polygon
/// without area gives none. Repeated corners (a hole joined to the outline by a double edge) are
/// allowed. Takes linear time for convex polygons, otherwise at most the number of corners times
/// the number of concave corners.
[[nodiscard]] Triangulation triangulate(std::span<const Vec3> corners);

}  // namespace lenticule::render
