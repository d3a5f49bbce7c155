// SPDX-License-Identifier: Apache-2.0
// Shoots rays at corners and edges of regular closed meshes, from outside and from inside: none may
// pass through.
#include <fmt/format.h>

#include <array>
#include <atomic>
#include <random>

#include "apps/lenticule-bench/probes/probe.h"
#include "apps/lenticule-bench/stability/rows.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"

namespace lenticule::bench {
namespace {

constexpr double kRadius = 40.0;
constexpr size_t kRaysPerPart = 4096;

/// A closed ball and the origins of the rays at it.
struct Target {
  explicit Target(uint32_t rings) : scene(description(rings), render_stage(), {}, 0), probe(scene) {
    mesh = ball_mesh({}, kRadius, rings);
    corners = probe.corners(0);
  }
  static render::SceneDescription description(uint32_t rings) {
    render::SceneDescription scene;
    scene.source = "ball";
    scene.materials = {render::Material{}};
    scene.meshes = {ball_mesh({}, kRadius, rings)};
    return scene;
  }
  static render::Stage render_stage() { return plain_stage(); }

  render::Scene scene;
  Probe probe;
  render::TriangleMesh mesh;
  std::vector<Vec3> corners;
};

/// Targets of the rays from a random place inside the ball: consecutive corners, points of edges,
/// or any points.
enum class Aim { Corners, Edges, Anywhere };

Vec3 random_inside(std::mt19937_64& random, double radius) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Vec3 p;
  do p = {unit(random), unit(random), unit(random)};
  while (dot(p, p) > 1.0 || dot(p, p) < 1e-6);
  return p * radius;
}

std::vector<ProbeRay> rays_from_inside(const Target& target, Aim aim, uint64_t part) {
  std::mt19937_64 random(part * 7919 + static_cast<uint64_t>(aim));
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const Vec3 from = part % 16 == 0 ? Vec3{} : random_inside(random, 0.9 * kRadius);
  const size_t first = random() % target.mesh.triangles.size();
  std::vector<ProbeRay> rays;
  for (size_t k = 0; k < kRaysPerPart; ++k) {
    const auto& triangle = target.mesh.triangles[(first + k) % target.mesh.triangles.size()];
    const Vec3 a = target.corners[triangle[0]];
    const Vec3 b = target.corners[triangle[1]];
    const double part_of_way = share(random);
    Vec3 at = a;
    if (aim == Aim::Edges) at = a * (1.0 - part_of_way) + b * part_of_way;
    if (aim == Aim::Anywhere) at = random_inside(random, kRadius) * 3.0;
    rays.push_back({from, normalized(at - from)});
  }
  return rays;
}

StabilityRow count_holes(const StabilitySize& size, Aim aim, const char* stressed) {
  const std::array<Target, 3> targets{Target(16), Target(60), Target(250)};
  const uint64_t parts = size.samples(1'500'000, 100'000'000) / kRaysPerPart + 1;
  SharedTally shared;
  std::atomic<uint64_t> filled{0};
  for_each_part(size, parts, [&](uint64_t part) {
    const Target& target = targets[part % targets.size()];
    const std::vector<ProbeRay> rays = rays_from_inside(target, aim, part);
    std::vector<ProbeHit> hits(rays.size());
    filled += target.probe.trace(rays, HoleGuard::On, hits);
    Tally tally;
    // A ray from inside that hits no surface has passed through a hole.
    for (const ProbeHit& hit : hits) tally.check(hit.what == ProbeHit::What::Surface);
    shared.add(tally);
  });
  return {.stressed = stressed,
          .samples = shared.sum().samples,
          .samples_are = "rays",
          .failures = shared.sum().failures,
          .failures_are = "holes",
          .note = fmt::format("{} rays passed through cracks and were caught", filled.load())};
}

}  // namespace

StabilityRow stability_corners(const StabilitySize& size) {
  return count_holes(size, Aim::Corners, "rays exactly at corners of closed meshes, from inside");
}

StabilityRow stability_edges(const StabilitySize& size) {
  return count_holes(size, Aim::Edges, "rays exactly at edges of closed meshes, from inside");
}

StabilityRow stability_inside(const StabilitySize& size) {
  return count_holes(size, Aim::Anywhere, "rays anywhere from inside closed meshes: none escapes");
}

}  // namespace lenticule::bench
