// SPDX-License-Identifier: Apache-2.0
// Intersection with triangles that are too wide for single precision, in closed form and double
// precision.
//
// The rounding error of a triangle in single precision is proportional to its extent. For a ground
// that extends to the horizon this error is larger than the objects on it: shadows would be
// displaced from the objects that cast them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "render/accel/quadrics.h"

namespace lenticule::render {

/// Scene units, which are millimetres on the panel. Shapes wider than this, and wider than their
/// distance, are intersected and shaded in double precision.
inline constexpr double kWidest = 2048.0;

/// Returns the extent to use in rounding margins: the rounding error on a shape is proportional to
/// the larger of its coordinates and this value. Wide shapes count as no wider than kWidest, plus
/// the roundings of double precision.
[[nodiscard]] inline double wide_reach(double extent) {
  return kWidest + extent * 0x1p-24;
}

struct WideTriangle {
  std::array<Vec3, 3> corner{};
  Vec3 normal{};            ///< unit; sign by the orientation of the corners
  Vec3 u_axis{}, v_axis{};  ///< dot products with (point - corner 0) give the barycentrics u and v
  Vec3 slope{};             ///< largest change of u, v and u + v per unit of length
  double reach = 0.0;       ///< wide_reach()
  uint32_t geometry = 0;    ///< Embree's numbers of the mesh's triangle
  uint32_t primitive = 0;
};

/// Returns the largest component of the edges from the first corner.
[[nodiscard]] double extent_of(const std::array<Vec3, 3>& corner);
/// Returns true if the triangle is wider than kWidest and wider than its distance from the origin.
[[nodiscard]] bool is_wide(const std::array<Vec3, 3>& corner);
/// Makes a wide triangle. The caller sets `geometry` and `primitive`.
[[nodiscard]] WideTriangle make_wide_triangle(const std::array<Vec3, 3>& corner);
[[nodiscard]] Box box_of(const WideTriangle& triangle);

/// Tolerance at edges, as a fraction of the coordinates. Rays this close outside an edge hit the
/// triangle too: corners of narrower neighbours are rounded to single precision, and no ray may
/// pass between the triangles.
inline constexpr double kEdgeRoom = 0x1p-21;

/// Intersects a line with a triangle. `direction` need not be unit.
[[nodiscard]] inline Roots meet(const WideTriangle& triangle, Vec3 origin, Vec3 direction) {
  const Vec3 from_corner = origin - triangle.corner[0];
  const double t = -dot(from_corner, triangle.normal) / dot(direction, triangle.normal);
  const Vec3 at = from_corner + direction * t;
  const Vec3 p = at + triangle.corner[0];
  const double room = kEdgeRoom * std::max(std::max(std::abs(p.x), std::abs(p.y)), std::abs(p.z));
  const double u = dot(at, triangle.u_axis);
  const double v = dot(at, triangle.v_axis);
  // False if t is NaN.
  const bool inside = u >= -(room * triangle.slope.x) && v >= -(room * triangle.slope.y) &&
                      u + v <= 1.0 + room * triangle.slope.z;
  return inside ? Roots{.count = 1, .t = {t, 0.0}} : Roots{};
}

}  // namespace lenticule::render
