// SPDX-License-Identifier: Apache-2.0
#include "render/accel/quadrics.h"

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

double extent_of(const SphereShape& sphere) {
  return sphere.radius;
}

double extent_of(const ConeShape& cone) {
  return std::max({cone.height, cone.base_radius, cone.base_radius + cone.slope * cone.height});
}

Vec3 disc_extent(Vec3 unit_normal, double radius) {
  const auto side = [&](double n) { return radius * std::sqrt(std::max(0.0, 1.0 - n * n)); };
  return {side(unit_normal.x), side(unit_normal.y), side(unit_normal.z)};
}

Box box_of(const SphereShape& sphere) {
  const Vec3 reach{sphere.radius, sphere.radius, sphere.radius};
  return {sphere.centre - reach, sphere.centre + reach};
}

Box box_of(const ConeShape& cone) {
  const Vec3 apex = cone.base + cone.axis * cone.height;
  const Vec3 at_base = disc_extent(cone.axis, cone.base_radius);
  const Vec3 at_apex = disc_extent(cone.axis, cone.base_radius + cone.slope * cone.height);
  const auto least = [](Vec3 a, Vec3 b) {
    return Vec3{std::fmin(a.x, b.x), std::fmin(a.y, b.y), std::fmin(a.z, b.z)};
  };
  return {least(cone.base - at_base, apex - at_apex),
          -least(-(cone.base + at_base), -(apex + at_apex))};
}

}  // namespace lenticule::render
