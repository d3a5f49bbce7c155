// SPDX-License-Identifier: Apache-2.0
// Tests coplanar surfaces, grazing rays, eyes on the panel, and objects that cross the panel and
// the eye's plane.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "apps/lenticule-bench/probes/probe.h"
#include "apps/lenticule-bench/stability/oracle_picture.h"
#include "apps/lenticule-bench/stability/phase_oracle.h"
#include "apps/lenticule-bench/stability/ray_oracle.h"
#include "apps/lenticule-bench/stability/small_scenes.h"
#include "apps/lenticule-bench/stability/tally.h"
#include "optics/row_rays.h"

namespace lenticule::bench {
StabilityRow stability_coplanar(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0, 0, 0});
  scene.materials = {glowing({0.4, 0.4, 0.4}), glowing({0.8, 0.8, 0.8})};
  for (const int material : {0, 1, 0}) {
    scene.meshes.push_back(grid_mesh({-90, -90, 3}, {181, 3, 7}, {-2, 179, 5}, 13));
    scene.meshes.back().material = material;
  }
  optics::Rig rig = small_rig();
  rig.panel.width_px *= 2;  // the panel becomes wider and stays within the sheets
  if (size.full) rig = finer(rig, 4);
  Tally tally;
  const frames::WovenFrame first = render_small(scene, plain_stage(), rig, 1);
  for (const uint8_t code : first.bytes()) tally.check(code == 102 || code == 204);
  for (const int threads : {2, 3, 8}) {
    const frames::WovenFrame again = render_small(scene, plain_stage(), rig, threads);
    for (size_t k = 0; k < first.bytes().size(); ++k)
      tally.check(again.bytes()[k] == first.bytes()[k]);
  }
  return {.stressed = "three sheets in one plane: one of them, and the same for 1, 2, 3, 8 threads",
          .samples = tally.samples,
          .samples_are = "subpixels",
          .failures = tally.failures,
          .failures_are = "holes or changes"};
}

StabilityRow stability_grazing(const StabilitySize& size) {
  constexpr double kReach = 3000.0;
  // A rounded height moves the intersection of a ray with a plane along the ray, by an amount
  // proportional to 1 / slope. Near an edge of the triangle the point cannot move along, and is at
  // most that far off the ray. Below this slope that exceeds the rounding of the point itself.
  constexpr double kGrazing = 1e-4;
  render::SceneDescription scene;
  scene.source = "plane";
  scene.materials = {render::Material{}};
  scene.meshes = {
      grid_mesh({-kReach, -31.1, -kReach}, {2 * kReach, 51.7, 0}, {0, -23.3, 2 * kReach}, 64)};
  const render::Scene committed(scene, plain_stage(), {}, 1);
  const Probe probe(committed);
  const std::vector<Vec3> corners = probe.corners(0);
  const Vec3 normal =
      normalized(cross(corners[65 * 64] - corners.front(), corners[64] - corners.front()));
  SharedTally shared;
  for_each_part(size, size.samples(200, 20'000), [&](uint64_t part) {
    std::mt19937_64 random(part);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    std::vector<ProbeRay> rays;
    std::vector<double> slopes;
    for (int k = 0; k < 1024; ++k) {
      // 0.1 mm to a metre away from a point of the plane, at a slope of 0.3 to 0.00003.
      const Vec3 foot = corners.front() +
                        (corners[64] - corners.front()) * (0.5 + 0.2 * unit(random)) +
                        (corners[65 * 64] - corners.front()) * (0.5 + 0.2 * unit(random));
      const double slope = std::pow(10.0, -2.5 + 2.0 * unit(random));
      const double distance = std::pow(10.0, 1.0 + 2.0 * unit(random));
      const Vec3 along = normalized(cross(normal, Vec3{unit(random), unit(random), unit(random)}));
      const Vec3 up = dot(normal, Vec3{0, 1, 0}) > 0 ? normal : -normal;
      const Vec3 way = normalized(along - up * slope);
      rays.push_back({foot - way * distance, way});
      slopes.push_back(slope);
    }
    std::vector<ProbeHit> hits(rays.size());
    (void)probe.trace(rays, HoleGuard::On, hits);
    Tally tally;
    for (size_t k = 0; k < rays.size(); ++k) {
      tally.check(hits[k].what == ProbeHit::What::Surface);
      if (hits[k].what != ProbeHit::What::Surface) continue;
      // Distance of the point from the ray.
      const Vec3 off = cross(hits[k].point - rays[k].origin, rays[k].direction);
      tally.error(length(off) * std::min(1.0, slopes[k] / kGrazing));
    }
    shared.add(tally);
  });
  return {.stressed =
              "rays at slopes of 0.3 to 0.00003 over a plane of 6 m: hit, with the hit point on "
              "the ray",
          .samples = shared.sum().samples,
          .samples_are = "rays",
          .failures = shared.sum().failures,
          .failures_are = "misses",
          .worst = shared.sum().worst,
          .bound = 0.01,
          .unit = "mm"};
}

StabilityRow stability_eye_on_panel(const StabilitySize& size) {
  const optics::Rig rig = small_rig();
  const optics::OpticalModel model(rig);
  SharedTally shared;
  for_each_part(size, size.samples(200, 20'000), [&](uint64_t part) {
    std::mt19937_64 random(part);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    Tally tally;
    for (int k = 0; k < 64; ++k) {
      const int i = static_cast<int>(random() % 160), j = static_cast<int>(random() % 96);
      const optics::Eye eye{40.0 * unit(random), 24.0 * unit(random),
                            std::pow(10.0, -1.5 + 4.5 * unit(random))};
      const Real ground_truth = oracle_phase(rig, i, j, 1, {eye.x, eye.y, eye.z_mm});
      std::vector<double> row;
      optics::RowPhaseEvaluator(model, eye).evaluate(j, i, i + 1, row);
      for (const double phase : {model.phase(i + 0.5, j + 0.5, 1, eye), row[1]}) {
        tally.check(std::isfinite(phase));
        tally.error(static_cast<double>(std::fabs(Real(phase) - ground_truth)));
      }
    }
    shared.add(tally);
  });
  return {.stressed = "eyes from a metre down to a millionth of a millimetre in front of the panel",
          .samples = shared.sum().samples,
          .samples_are = "phases",
          .failures = shared.sum().failures,
          .failures_are = "not finite",
          .worst = shared.sum().worst,
          .bound = 1e-9,
          .unit = "lens"};
}

StabilityRow stability_through_eye(const StabilitySize& size) {
  render::SceneDescription scene = dark_scene({0.05, 0.1, 0.15});
  scene.materials = {glowing({0.9, 0.5, 0.3}), glowing({0.2, 0.6, 0.8}), glowing({0.5, 0.5, 0.1}),
                     glowing({0.4, 0.8, 0.6})};
  // A beam from behind the panel to behind the eye, a wall through panel and eye, a ball half in
  // front of the panel.
  scene.meshes = {box_mesh({7.3, -9.1, -211.0}, {13.9, -3.7, 633.0}, 0),
                  grid_mesh({-31.7, -37.1, -97.0}, {3.1, 0.7, 801.0}, {9.3, 61.9, 0.0}, 3),
                  grid_mesh({-60.0, 11.0, -150.0}, {120.0, 1.1, 0.0}, {0.0, 3.7, 1100.0}, 5)};
  scene.meshes[1].material = 1;
  scene.meshes[2].material = 2;
  scene.spheres = {{.centre = {21.1, 3.3, 0.9}, .radius = 9.7, .material = 3}};
  optics::Rig rig = small_rig();
  if (size.full) rig = finer(rig, 4);
  StabilityRow row = compare_with_oracle(scene, rig, size);
  row.stressed = "a beam, walls and a ball through the panel plane and the plane of the eyes";
  return row;
}

}  // namespace lenticule::bench
