// SPDX-License-Identifier: Apache-2.0
// Tests that no ray passes through a closed mesh, even if it aims exactly at an edge.
#include <gtest/gtest.h>

#include <algorithm>

#include "lab/stability/probes.h"
#include "render/accel/ray_stream.h"
#include "render/scene/scene.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

class Watertight : public ::testing::Test {
 protected:
  Watertight() {
    SceneDescription scene;
    scene.materials = {Material{}};
    scene.meshes = {test::ball_mesh({0, 0, 0}, 5.0, 40, 0)};
    scene_ = std::make_unique<Scene>(scene, test::make_tiny_stage({.mm_per_unit = 1.0}),
                                     Surroundings{}, 1);
  }

  [[nodiscard]] const MeshShape& mesh() const { return scene_->meshes[0]; }

  void aim(Vec3 from, Vec3 at) {
    PathRay ray;
    ray.origin = from;
    ray.direction = normalized(at - from);
    ray.target = 0;
    rays_.push_back(ray);
  }

  [[nodiscard]] size_t misses(Coherence coherence) const {
    std::vector<Hit> hits(rays_.size());
    EXPECT_EQ(lab::intersect(scene_->embree, rays_, coherence, hits), 0U);
    size_t count = 0;
    for (const Hit& hit : hits)
      if (hit.geometry == Hit::kMiss) ++count;
    return count;
  }

  std::unique_ptr<Scene> scene_;
  std::vector<PathRay> rays_;
};

constexpr Vec3 kInside[] = {{0, 0, 0}, {1.3, -0.7, 2.1}, {-3.9, 0.1, 0.2}};

TEST_F(Watertight, RaysAtPointsOfEdgesStayInside) {
  for (const Vec3 from : kInside)
    for (const auto& triangle : mesh().triangles)
      for (size_t k = 0; k < 3; ++k) {
        const Vec3 a(mesh().positions[triangle[k]]);
        const Vec3 b(mesh().positions[triangle[(k + 1) % 3]]);
        for (const double part : {0.1, 0.37, 0.5, 0.83}) aim(from, a * (1.0 - part) + b * part);
      }
  EXPECT_GT(rays_.size(), 200000U);
  EXPECT_EQ(misses(Coherence::Incoherent), 0U);
  EXPECT_EQ(misses(Coherence::Coherent), 0U);
}

/// Exactly at a corner Embree's robust mode lets a few rays pass between the triangles around it.
TEST_F(Watertight, RaysAtCornersAreCaughtByTheGuard) {
  std::vector<lab::ProbeRay> rays;
  for (const Vec3 from : kInside)
    for (size_t k = 0; k + 1 < mesh().positions.size(); ++k) {
      const Vec3 at(mesh().positions[k]);
      rays.push_back({from, normalized(at - from)});
    }
  const lab::Probe probe(*scene_);
  const auto misses_with = [&](lab::HoleGuard guard) {
    std::vector<lab::ProbeHit> hits(rays.size());
    (void)probe.trace(rays, guard, hits);
    return std::ranges::count(hits, lab::ProbeHit::What::Nothing, &lab::ProbeHit::what);
  };
  EXPECT_GT(misses_with(lab::HoleGuard::Off), 0) << "nothing to catch";
  EXPECT_EQ(misses_with(lab::HoleGuard::On), 0);
}

}  // namespace
}  // namespace lenticule::render
