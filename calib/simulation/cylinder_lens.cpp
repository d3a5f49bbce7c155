// SPDX-License-Identifier: Apache-2.0
// Refracts rays at the surface of one cylinder lens and at the flat faces under or above it.
#include "calib/simulation/cylinder_lens.h"

#include <cmath>

namespace lenticule::calib {
namespace {

constexpr Vec3 kFlat{0, 0, 1};

/// Moves `point` along `direction` down to the plane z.
Vec3 go_to_plane(Vec3 point, Vec3 direction, double z) {
  return point + direction * ((z - point.z) / direction.z);
}

/// Incidence is a point on the surface of a lens and the direction of the arriving light.
struct Incidence {
  Vec3 point;
  Vec3 normal;  // opposite to the light
  Vec3 direction;
};

/// Traces the light behind the curved surface, down to the pixels.
std::optional<Vec2> land_from_surface(const LensStack& stack, const Incidence& at) {
  const double ratio = stack.lens_toward_panel ? stack.index : 1.0 / stack.index;
  const std::optional<Vec3> bent = refract(at.direction, at.normal, ratio);
  if (!bent || !(bent->z < 0)) return std::nullopt;
  if (stack.lens_toward_panel) {
    const Vec3 landing = go_to_plane(at.point, *bent, -stack.air_gap_mm);
    return Vec2{landing.x, landing.y};
  }
  const Vec3 face = go_to_plane(at.point, *bent, -stack.thickness_mm);
  if (stack.air_gap_mm == 0.0) return Vec2{face.x, face.y};
  const std::optional<Vec3> out = refract(*bent, kFlat, stack.index);
  if (!out) return std::nullopt;
  const Vec3 landing = go_to_plane(face, *out, -stack.thickness_mm - stack.air_gap_mm);
  return Vec2{landing.x, landing.y};
}

/// Returns the point where the ray meets the cylinder whose apex is at u = 0. Its axis lies a
/// radius below the apices, or above them if they face the panel; `start` is on the plane z = 0.
std::optional<Incidence> meet_cylinder(const LensStack& stack, Vec2 start, Vec3 d) {
  const double axis_z = stack.lens_toward_panel ? stack.radius_mm : -stack.radius_mm;
  const double a = d.x * d.x + d.z * d.z;
  const double b = start.x * d.x - axis_z * d.z;
  const double c = start.x * start.x;
  const double discriminant = b * b - a * c;
  if (discriminant < 0) return std::nullopt;
  // Selects the intersection near the apex; this form is numerically stable there.
  const double root = std::sqrt(discriminant);
  const double along = stack.lens_toward_panel ? -c / (b + root) : c / (-b + root);
  const Vec3 point = Vec3{start.x, start.y, 0} + d * along;
  const double side = stack.lens_toward_panel ? -1.0 : 1.0;
  const Vec3 normal = Vec3{point.x, 0, point.z - axis_z} * (side / stack.radius_mm);
  return Incidence{point, normal, d};
}

Incidence surface_at(const LensStack& stack, double u) {
  const double depth = std::sqrt(stack.radius_mm * stack.radius_mm - u * u);
  const double sag = stack.radius_mm - depth;
  Incidence at;
  const double side = stack.lens_toward_panel ? -1.0 : 1.0;
  at.point = {u, 0, -side * sag};
  at.normal = Vec3{side * u, 0, depth} / stack.radius_mm;
  return at;
}

/// Returns the direction inside the slab of light from `eye` that reaches `point` under the slab's
/// upper face. The aim is corrected by the miss in each step: the slab bends so little that each
/// step gains two digits or more.
std::optional<Vec3> aim_through_slab(const LensStack& stack, Vec3 eye, Vec3 point) {
  Vec3 entry{point.x, point.y, stack.thickness_mm};
  std::optional<Vec3> inside;
  for (int step = 0; step < 30; ++step) {
    inside = refract(normalized(entry - eye), kFlat, 1.0 / stack.index);
    if (!inside) return std::nullopt;
    const Vec3 miss = point - go_to_plane(entry, *inside, point.z);
    entry = entry + Vec3{miss.x, miss.y, 0};
    if (std::abs(miss.x) + std::abs(miss.y) < 1e-14) break;
  }
  return inside;
}

}  // namespace

std::optional<Vec3> refract(Vec3 direction, Vec3 normal, double ratio) {
  const double cosine = -dot(direction, normal);
  if (!(cosine > 0)) return std::nullopt;
  const double squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
  if (!(squared > 0)) return std::nullopt;
  return direction * ratio + normal * (ratio * cosine - std::sqrt(squared));
}

std::optional<Vec2> land(const LensStack& stack, Vec2 start, Vec3 direction) {
  Vec3 d = direction;
  if (stack.lens_toward_panel) {
    const std::optional<Vec3> inside = refract(direction, kFlat, 1.0 / stack.index);
    if (!inside) return std::nullopt;
    // The upper face is a thickness above the apices; below the face the ray is steeper.
    start = start + Vec2{inside->x / -inside->z - d.x / -d.z, inside->y / -inside->z - d.y / -d.z} *
                        stack.thickness_mm;
    d = *inside;
  }
  const double half = stack.pitch_mm / 2.0;
  double apex = std::round(start.x / stack.pitch_mm) * stack.pitch_mm;
  for (int neighbour = 0; neighbour < 3; ++neighbour) {
    const std::optional<Incidence> at = meet_cylinder(stack, {start.x - apex, start.y}, d);
    if (at && std::abs(at->point.x) <= half * (1.0 + 1e-12)) {
      const std::optional<Vec2> landing = land_from_surface(stack, *at);
      if (!landing) return std::nullopt;
      return Vec2{landing->x + apex, landing->y};
    }
    const double reached = at ? at->point.x : d.x;
    apex += reached > 0 ? stack.pitch_mm : -stack.pitch_mm;
  }
  return std::nullopt;
}

std::optional<ApertureRay> aperture_ray(const LensStack& stack, double u, Vec3 eye) {
  Incidence at = surface_at(stack, u);
  std::optional<Vec3> arriving = normalized(at.point - eye);
  if (stack.lens_toward_panel) arriving = aim_through_slab(stack, eye, at.point);
  if (!arriving) return std::nullopt;
  at.direction = *arriving;
  const double facing = -dot(at.direction, at.normal) / at.normal.z / -at.direction.z;
  if (!(facing > 0)) return std::nullopt;
  const std::optional<Vec2> landing = land_from_surface(stack, at);
  if (!landing) return std::nullopt;
  return ApertureRay{*landing, facing};
}

Vec2 straight_aim(const LensStack& stack, Vec3 eye) {
  if (!stack.lens_toward_panel) return {};
  const std::optional<Vec3> inside = aim_through_slab(stack, eye, Vec3{});
  if (!inside) return {};
  const Vec3 entry = *inside * (stack.thickness_mm / inside->z);
  const Vec3 aim = go_to_plane(entry, entry - eye, 0.0);
  return {aim.x, aim.y};
}

}  // namespace lenticule::calib
