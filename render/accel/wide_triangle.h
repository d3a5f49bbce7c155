// SPDX-License-Identifier: Apache-2.0
// Triangles too wide for single precision, met by rays in closed form and double precision.
//
// Single precision says where a triangle is to a part of its extent. Of a ground that runs to the
// horizon that part is larger than all that stands on it: shadows would lie beside what casts them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "render/accel/quadrics.h"

namespace lenticule::render {

/// Scene units, which are millimetres on the glass: shapes that are wider than this, and wider than
/// they are far away, are met and shaded in double precision.
inline constexpr double kWidest = 2048.0;

/// What rounding may be wrong by on a shape is a part of its largest coordinate there and of this.
/// Wide shapes count as if they were no wider than kWidest, but for the roundings of double
/// precision.
[[nodiscard]] inline double wide_reach(double extent) {
  return kWidest + extent * 0x1p-24;
}

struct WideTriangle {
  std::array<Vec3, 3> corner{};
  Vec3 normal{};            ///< unit, by the turn of the corners
  Vec3 u_axis{}, v_axis{};  ///< their products with a point from corner 0 on are its barycentrics
  Vec3 slope{};             ///< how much u, v and their sum change at most along a unit of length
  double reach = 0.0;       ///< wide_reach()
  uint32_t geometry = 0;    ///< Embree's numbers of the triangle of the mesh
  uint32_t primitive = 0;
};

/// The largest component of the edges from the first corner on.
[[nodiscard]] double extent_of(const std::array<Vec3, 3>& corner);
/// Whether it is wider than kWidest and than its distance from the origin.
[[nodiscard]] bool is_wide(const std::array<Vec3, 3>& corner);
/// Geometry and primitive are left to the caller.
[[nodiscard]] WideTriangle make_wide_triangle(const std::array<Vec3, 3>& corner);
[[nodiscard]] Box box_of(const WideTriangle& triangle);

/// Rays that pass an edge closer than this part of the coordinates meet the triangle, too: corners
/// of narrower neighbours are rounded to single precision, and no ray may slip through between.
inline constexpr double kEdgeRoom = 0x1p-21;

/// `direction` need not have unit length.
[[nodiscard]] inline Roots meet(const WideTriangle& triangle, Vec3 origin, Vec3 direction) {
  const Vec3 from_corner = origin - triangle.corner[0];
  const double t = -dot(from_corner, triangle.normal) / dot(direction, triangle.normal);
  const Vec3 at = from_corner + direction * t;
  const Vec3 p = at + triangle.corner[0];
  const double room = kEdgeRoom * std::max(std::max(std::abs(p.x), std::abs(p.y)), std::abs(p.z));
  const double u = dot(at, triangle.u_axis);
  const double v = dot(at, triangle.v_axis);
  // False where t is not a number.
  const bool inside = u >= -(room * triangle.slope.x) && v >= -(room * triangle.slope.y) &&
                      u + v <= 1.0 + room * triangle.slope.z;
  return inside ? Roots{.count = 1, .t = {t, 0.0}} : Roots{};
}

}  // namespace lenticule::render
