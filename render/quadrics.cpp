// SPDX-License-Identifier: Apache-2.0
#include "render/quadrics.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lenticule::render {

Roots quadratic_roots(double a, double half_b, double c) {
  const double discriminant = half_b * half_b - a * c;
  if (!(discriminant >= 0.0)) return {};
  // Both terms of q have one sign, so nothing cancels; the other root follows from the product.
  const double q = -(half_b + std::copysign(std::sqrt(discriminant), half_b));
  if (q == 0.0) return a == 0.0 ? Roots{} : Roots{.count = 2, .t = {0.0, 0.0}};
  if (a == 0.0) return {.count = 1, .t = {c / q, 0.0}};
  const auto [low, high] = std::minmax({q / a, c / q});
  return {.count = 2, .t = {low, high}};
}

Roots meet(const SphereShape& sphere, Vec3 origin, Vec3 direction) {
  // From the point of the line nearest to the centre: no large squares cancel, however far away the
  // ray starts.
  const double squared = dot(direction, direction);
  const double nearest = dot(sphere.centre - origin, direction) / squared;
  const Vec3 off_centre = origin + direction * nearest - sphere.centre;
  const double half_chord_squared =
      (sphere.radius * sphere.radius - dot(off_centre, off_centre)) / squared;
  if (!(half_chord_squared >= 0.0)) return {};
  const double half_chord = std::sqrt(half_chord_squared);
  return {.count = 2, .t = {nearest - half_chord, nearest + half_chord}};
}

Roots meet(const ConeShape& cone, Vec3 origin, Vec3 direction) {
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
