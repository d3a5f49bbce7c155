// SPDX-License-Identifier: Apache-2.0
// Tests single convex objects: no surface can lie between the lit side and the light.
#include <fmt/format.h>

#include <random>

#include "apps/lenticule-bench/probes/probe.h"
#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"

namespace lenticule::bench {
namespace {

constexpr size_t kRaysPerPart = 2048;
constexpr double kSize = 50.0;  // size of the object, mm on the panel

enum class Kind { Triangle, Sphere, Cone, Cylinder };

render::SceneDescription object(Kind kind, Vec3 at) {
  render::SceneDescription scene;
  scene.source = "convex object";
  scene.materials = {render::Material{}};
  const auto along = [&](Vec3 p) { return at + p * kSize; };
  if (kind == Kind::Triangle) {
    // A tetrahedron stays convex, however its corners are rounded.
    scene.meshes.push_back({.name = "tetrahedron",
                            .positions = {along({-0.71, -0.53, 0.62}), along({0.83, -0.47, 0.31}),
                                          along({0.07, 0.91, 0.13}), along({0.11, -0.29, -0.87})},
                            .triangles = {{0, 1, 2}, {1, 3, 2}, {3, 0, 2}, {0, 3, 1}}});
  } else if (kind == Kind::Sphere) {
    scene.spheres.push_back({.centre = at, .radius = 0.7 * kSize});
  } else {
    scene.cones.push_back({.base = along({-0.3, -0.7, 0.1}),
                           .base_radius = 0.5 * kSize,
                           .apex = along({0.2, 0.8, -0.1}),
                           .apex_radius = (kind == Kind::Cylinder ? 0.5 : 0.1) * kSize});
  }
  return scene;
}

Vec3 random_direction(std::mt19937_64& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vec3 v;
  do v = {unit(random), unit(random), unit(random)};
  while (dot(v, v) > 1.0 || dot(v, v) < 1e-4);
  return normalized(v);
}

/// Returns a direction away from the surface, in half of the cases a hundredth of a degree above
/// it.
Vec3 away(Vec3 normal, std::mt19937_64& random) {
  const Vec3 v = random_direction(random);
  if (random() % 2 == 0) return dot(v, normal) > 0.0 ? v : -v;
  return normalized(normalized(cross(normal, v)) + normal * 1.7e-4);
}

/// Shoots rays at the object at `from_centre`, and from every hit on its outer side a ray toward a
/// light.
Tally count(const Probe& probe, Vec3 from_centre, uint64_t part) {
  std::mt19937_64 random(part + 1);
  std::vector<ProbeRay> rays;
  for (size_t k = 0; k < kRaysPerPart; ++k) {
    const Vec3 from = from_centre + random_direction(random) * (3.0 * kSize);
    const Vec3 at = from_centre + random_direction(random) * (0.4 * kSize);
    rays.push_back({from, normalized(at - from)});
  }
  std::vector<ProbeHit> hits(rays.size());
  (void)probe.trace(rays, HoleGuard::On, hits);
  std::vector<Vec3> directions;
  for (ProbeHit& hit : hits) {
    if (!hit.outer_side) hit.what = ProbeHit::What::Nothing;  // the inside of an open cone
    directions.push_back(away(hit.geometric_normal, random));
  }
  std::vector<uint8_t> blocked(hits.size());
  probe.leave(hits, directions, blocked);
  Tally tally;
  for (size_t k = 0; k < hits.size(); ++k)
    if (hits[k].what == ProbeHit::What::Surface) tally.check(blocked[k] == 0);
  return tally;
}

/// Places the object anywhere in the world with the placement centred on it, or off the placement's
/// centre.
enum class Place { InTheWorld, OffTheStage };

Tally count_at(const StabilitySize& size, Kind kind, Place place, double offset, uint64_t rays) {
  const Vec3 at{offset, -0.7 * offset, 0.4 * offset};
  const bool moved = place == Place::InTheWorld;
  const render::Scene scene(object(kind, at), plain_stage(moved ? at : Vec3{}), {}, 1);
  const Probe probe(scene);
  SharedTally shared;
  for_each_part(size, rays / kRaysPerPart + 1,
                [&](uint64_t part) { shared.add(count(probe, moved ? Vec3{} : at, part)); });
  return shared.sum();
}

StabilityRow shadows(const StabilitySize& size, Kind kind, const char* stressed) {
  Tally sum;
  const uint64_t rays = size.samples(400'000, 250'000'000) / 8;
  for (const double offset : {0.0, 1e3, 1e5, 1e6, 1e7})
    sum += count_at(size, kind, Place::InTheWorld, offset, rays);
  for (const double offset : {1e3, 1e4, 1e5})
    sum += count_at(size, kind, Place::OffTheStage, offset, rays);
  return {.stressed = stressed,
          .samples = sum.samples,
          .samples_are = "rays",
          .failures = sum.failures,
          .failures_are = "false shadows"};
}

}  // namespace

StabilityRow stability_shadow_triangle(const StabilitySize& size) {
  return shadows(size, Kind::Triangle,
                 "tetrahedron 50 mm, 0 to 10^7 units off in the world, to 10^5 mm off the stage");
}
StabilityRow stability_shadow_sphere(const StabilitySize& size) {
  return shadows(size, Kind::Sphere, "the same with a sphere");
}
StabilityRow stability_shadow_cone(const StabilitySize& size) {
  return shadows(size, Kind::Cone, "the same with the outside of a cone");
}
StabilityRow stability_shadow_cylinder(const StabilitySize& size) {
  return shadows(size, Kind::Cylinder, "the same with the outside of a cylinder");
}

StabilityRow stability_shadow_far(const StabilitySize& size) {
  Tally sum;
  std::string note;
  const uint64_t rays = size.samples(400'000, 40'000'000) / 8;
  for (const double offset : {1e6, 1e7})
    for (const Kind kind : {Kind::Triangle, Kind::Sphere, Kind::Cone, Kind::Cylinder}) {
      const Tally tally = count_at(size, kind, Place::OffTheStage, offset, rays);
      note += fmt::format("{}{} of {}", note.empty() ? "" : ", ", tally.failures, tally.samples);
      sum += tally;
    }
  return {.stressed = "all four 10^6 and 10^7 mm off the middle of the stage",
          .samples = sum.samples,
          .samples_are = "rays",
          .failures = sum.failures,
          .failures_are = "false shadows",
          .note = note};
}

}  // namespace lenticule::bench
