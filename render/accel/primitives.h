// SPDX-License-Identifier: Apache-2.0
// Intersection of rays, in closed form and double precision, with spheres, open cones, and
// triangles that are too wide for single precision.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "optics/vec.h"

namespace lenticule::render {

struct SphereShape {
  Vec3 centre;
  double radius = 1.0;
  bool inward = false;  ///< the outer side is the inside
  int material = 0;
};

/// ConeShape has radius(s) = base_radius + slope s for s in [0, height] along `axis`; a cylinder
/// has slope 0.
struct ConeShape {
  Vec3 base;
  Vec3 axis;  ///< unit, from base to apex
  double height = 1.0;
  double base_radius = 1.0;
  double slope = 0.0;
  bool inward = false;
  int material = 0;
};

/// Ray parameters of the intersections of a line with a surface, ascending.
struct Roots {
  int count = 0;
  double t[2] = {0.0, 0.0};
};

/// Returns the real roots of a t^2 + 2 half_b t + c, without the cancellation of the textbook
/// formula; a may be zero. A double root counts twice.
[[nodiscard]] inline Roots quadratic_roots(double a, double half_b, double c);

/// Intersects a line with a shape. `direction` need not be unit. Defined inline because Embree
/// calls the function ray by ray when few rays of a packet are left, and a call would cost more
/// than the computation.
[[nodiscard]] inline Roots meet(const SphereShape& sphere, Vec3 origin, Vec3 direction);
[[nodiscard]] inline Roots meet(const ConeShape& cone, Vec3 origin, Vec3 direction);

/// Returns the first root in (t_min, t_max), or t_max if there is none.
[[nodiscard]] inline double first_root(const Roots& roots, double t_min, double t_max) {
  for (int i = 0; i < roots.count; ++i)
    if (roots.t[i] > t_min && roots.t[i] < t_max) return roots.t[i];
  return t_max;
}

/// Returns the point of the surface nearest to a point that is almost on it.
[[nodiscard]] Vec3 project_onto(const SphereShape& sphere, Vec3 point);
[[nodiscard]] Vec3 project_onto(const ConeShape& cone, Vec3 point);

/// Returns the unit normal at a point of the surface, on its outer side; zero at the tip of a cone.
[[nodiscard]] Vec3 outer_normal(const SphereShape& sphere, Vec3 point);
[[nodiscard]] Vec3 outer_normal(const ConeShape& cone, Vec3 point);

/// Returns the largest dimension of the shape.
[[nodiscard]] double extent_of(const SphereShape& sphere);
[[nodiscard]] double extent_of(const ConeShape& cone);

/// Returns the box around a shape after a map.
[[nodiscard]] Box box_of(const SphereShape& sphere, const Affine& map = {});
[[nodiscard]] Box box_of(const ConeShape& cone, const Affine& map = {});

inline Roots quadratic_roots(double a, double half_b, double c) {
  const double discriminant = half_b * half_b - a * c;
  if (!(discriminant >= 0.0)) return {};
  // Both terms of q have the same sign, so nothing cancels; the other root follows from the
  // product.
  const double q = -(half_b + std::copysign(std::sqrt(discriminant), half_b));
  if (q == 0.0) return a == 0.0 ? Roots{} : Roots{.count = 2, .t = {0.0, 0.0}};
  if (a == 0.0) return {.count = 1, .t = {c / q, 0.0}};
  const auto [low, high] = std::minmax({q / a, c / q});
  return {.count = 2, .t = {low, high}};
}

inline Roots meet(const SphereShape& sphere, Vec3 origin, Vec3 direction) {
  // Starts at the point of the line nearest to the centre, so that no large squares cancel, even if
  // the ray starts far away.
  const double per_squared = 1.0 / dot(direction, direction);
  const double nearest = dot(sphere.centre - origin, direction) * per_squared;
  const Vec3 off_centre = origin + direction * nearest - sphere.centre;
  const double inside = sphere.radius * sphere.radius - dot(off_centre, off_centre);
  if (!(inside >= 0.0)) return {};
  const double half_chord = std::sqrt(inside * per_squared);
  return {.count = 2, .t = {nearest - half_chord, nearest + half_chord}};
}

inline Roots meet(const ConeShape& cone, Vec3 origin, Vec3 direction) {
  const Vec3 from_base = origin - cone.base;
  const double along = dot(from_base, cone.axis);
  const double along_step = dot(direction, cone.axis);
  const Vec3 across = from_base - cone.axis * along;
  const Vec3 across_step = direction - cone.axis * along_step;
  const double radius = cone.base_radius + cone.slope * along;
  const double radius_step = cone.slope * along_step;
  const Roots whole = quadratic_roots(dot(across_step, across_step) - radius_step * radius_step,
                                      dot(across, across_step) - radius * radius_step,
                                      dot(across, across) - radius * radius);
  Roots kept;
  for (int i = 0; i < whole.count; ++i) {
    const double s = along + whole.t[i] * along_step;
    if (s >= 0.0 && s <= cone.height) kept.t[kept.count++] = whole.t[i];
  }
  return kept;
}

// Intersection with triangles that are too wide for single precision, in closed form and double
// precision.
//
// The rounding error of a triangle in single precision is proportional to its extent. For a ground
// that extends to the horizon this error is larger than the objects on it: shadows would be
// displaced from the objects that cast them.

/// Scene units, of 0.76 to 1.53 millimetres on the panel. Shapes wider than this, and wider than
/// their distance, are intersected and shaded in double precision.
inline constexpr double kWidest = 2048.0;

/// Returns the extent to use in rounding margins: the rounding error on a shape is proportional to
/// the larger of its coordinates and this value. Wide shapes count as no wider than kWidest, plus
/// the roundings of double precision.
[[nodiscard]] inline double wide_reach(double extent) { return kWidest + extent * 0x1p-24; }

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
  const double room = kEdgeRoom * largest_size(p);
  const double u = dot(at, triangle.u_axis);
  const double v = dot(at, triangle.v_axis);
  // False if t is NaN.
  const bool inside = u >= -(room * triangle.slope.x) && v >= -(room * triangle.slope.y) &&
                      u + v <= 1.0 + room * triangle.slope.z;
  return inside ? Roots{.count = 1, .t = {t, 0.0}} : Roots{};
}

}  // namespace lenticule::render
