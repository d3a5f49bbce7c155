// SPDX-License-Identifier: Apache-2.0
#include "render/accel/primitives.h"

#include <algorithm>
#include <cmath>

namespace lenticule::render {

Vec3 project_onto(const SphereShape& sphere, Vec3 point) {
  return sphere.centre + normalized(point - sphere.centre) * sphere.radius;
}

Vec3 project_onto(const ConeShape& cone, Vec3 point) {
  const Vec3 from_base = point - cone.base;
  const double s = std::clamp(dot(from_base, cone.axis), 0.0, cone.height);
  const Vec3 outward = normalized(from_base - cone.axis * dot(from_base, cone.axis));
  return cone.base + cone.axis * s + outward * (cone.base_radius + cone.slope * s);
}

Vec3 outer_normal(const SphereShape& sphere, Vec3 point) {
  const Vec3 outward = normalized(point - sphere.centre);
  return sphere.inward ? -outward : outward;
}

Vec3 outer_normal(const ConeShape& cone, Vec3 point) {
  const Vec3 from_base = point - cone.base;
  const Vec3 across = normalized(from_base - cone.axis * dot(from_base, cone.axis));
  if (across == Vec3{}) return {};
  const Vec3 outward = normalized(across - cone.axis * cone.slope);
  return cone.inward ? -outward : outward;
}

double extent_of(const SphereShape& sphere) { return sphere.radius; }

double extent_of(const ConeShape& cone) {
  return std::max({cone.height, cone.base_radius, cone.base_radius + cone.slope * cone.height});
}

namespace {

/// Returns half the size of the box around a mapped disc, along each axis; around a ball if there
/// is no normal.
Vec3 disc_extent(const Affine& map, Vec3 normal, double radius) {
  const auto along = [&](double x, double y, double z) {
    const Vec3 row{x, y, z};
    const double lean = dot(row, normal);
    return radius * std::sqrt(std::max(0.0, dot(row, row) - lean * lean));
  };
  return {along(map.column_x.x, map.column_y.x, map.column_z.x),
          along(map.column_x.y, map.column_y.y, map.column_z.y),
          along(map.column_x.z, map.column_y.z, map.column_z.z)};
}

/// Returns the distance from zero to the nearest number in [low, high].
double distance_to_range(double low, double high) { return std::max({low, -high, 0.0}); }

}  // namespace

Box box_of(const SphereShape& sphere, const Affine& map) {
  const Vec3 centre = map.point(sphere.centre);
  const Vec3 reach = disc_extent(map, {}, sphere.radius);
  return {centre - reach, centre + reach};
}

Box box_of(const ConeShape& cone, const Affine& map) {
  const Vec3 base = map.point(cone.base);
  const Vec3 apex = map.point(cone.base + cone.axis * cone.height);
  const Vec3 at_base = disc_extent(map, cone.axis, cone.base_radius);
  const Vec3 at_apex = disc_extent(map, cone.axis, cone.base_radius + cone.slope * cone.height);
  return {min(base - at_base, apex - at_apex), max(base + at_base, apex + at_apex)};
}

double extent_of(const std::array<Vec3, 3>& corner) {
  return std::max(largest_size(corner[1] - corner[0]), largest_size(corner[2] - corner[0]));
}

Box box_of(const WideTriangle& triangle) {
  const auto& [a, b, c] = triangle.corner;
  return {min(min(a, b), c), max(max(a, b), c)};
}

bool is_wide(const std::array<Vec3, 3>& corner) {
  const double extent = extent_of(corner);
  if (!(extent > kWidest)) return false;
  const Box box = box_of(WideTriangle{.corner = corner});
  const double away =
      std::max({distance_to_range(box.low.x, box.high.x), distance_to_range(box.low.y, box.high.y),
                distance_to_range(box.low.z, box.high.z)});
  const Vec3 normal = cross(corner[1] - corner[0], corner[2] - corner[0]);
  return extent > away && dot(normal, normal) > 0.0;
}

WideTriangle make_wide_triangle(const std::array<Vec3, 3>& corner) {
  const Vec3 edge1 = corner[1] - corner[0];
  const Vec3 edge2 = corner[2] - corner[0];
  const Vec3 normal = cross(edge1, edge2);
  const double per_squared = 1.0 / dot(normal, normal);
  WideTriangle out{.corner = corner, .normal = normalized(normal)};
  out.u_axis = cross(edge2, normal) * per_squared;
  out.v_axis = cross(normal, edge1) * per_squared;
  out.slope = {length(out.u_axis), length(out.v_axis), length(out.u_axis + out.v_axis)};
  out.reach = wide_reach(extent_of(corner));
  return out;
}

}  // namespace lenticule::render
