// SPDX-License-Identifier: Apache-2.0
// What reaches Embree, and what does not.
#include "render/ray_stream.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/committed_scene.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A floor and a sphere above it: both kinds of geometry, in scene millimetres.
SceneDescription floor_and_sphere() {
  SceneDescription scene;
  scene.source = "test";
  scene.materials = {Material{}};
  scene.meshes = {testing::rectangle_mesh({-9, 0, 9}, {18, 0, 0}, {0, 0, -18}, 0)};
  scene.spheres = {{.centre = {0, 3, 0}, .radius = 1}};
  return scene;
}

class RayStream : public ::testing::Test {
 protected:
  Scene scene_{floor_and_sphere(), testing::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1};
  RTCScene embree_ = scene_.impl().embree.get();
};

PathRay ray(Vec3 origin, Vec3 direction) {
  return {.origin = origin, .direction = direction, .target = 0};
}

std::vector<Vec3> unusable_vectors() {
  return {{kNan, 0, 0},       {0, kNan, 0}, {0, 0, kNan},  {kInfinity, 0, 0},
          {0, -kInfinity, 0}, {1e30, 0, 0}, {0, 0, 1e300}, {0, -1e18, 0}};
}

TEST_F(RayStream, RaysThatAreNotFiniteAreCountedAndNeverReachEmbree) {
  // Embree ends the process when it meets one of these.
  for (const Vec3 bad : unusable_vectors()) {
    const std::vector<PathRay> rays = {ray({0, 9, 0}, {0, -1, 0}), ray(bad, {0, -1, 0}),
                                       ray({5, 9, 0}, bad)};
    std::vector<Hit> hits(rays.size());
    for (const Coherence coherence : {Coherence::Coherent, Coherence::Incoherent}) {
      EXPECT_EQ(intersect(embree_, rays, coherence, hits), 2U);
      EXPECT_EQ(hits[0].geometry, 1U);
      EXPECT_NEAR(hits[0].distance, 5.0, 1e-5);
      EXPECT_EQ(hits[1].geometry, Hit::kRefused);
      EXPECT_EQ(hits[2].geometry, Hit::kRefused);
    }
  }
}

TEST_F(RayStream, ShadowRaysThatAreNotFiniteAddNothing) {
  std::vector<double> light(1, 0.0);
  for (const Vec3 bad : unusable_vectors()) {
    const std::vector<ShadowRay> rays = {
        {.origin = bad, .direction = {0, 1, 0}, .distance = 1.0, .light = 1.0},
        {.origin = {5, 1, 0}, .direction = bad, .distance = 1.0, .light = 1.0},
        {.origin = {5, 1, 0}, .direction = {0, 1, 0}, .distance = kNan, .light = 1.0}};
    EXPECT_EQ(add_unshadowed(embree_, rays, light), 3U);
    EXPECT_EQ(light[0], 0.0);
  }
}

TEST_F(RayStream, ARayWithoutDirectionIsRefused) {
  const std::vector<PathRay> rays = {ray({0, 9, 0}, {0, 0, 0})};
  std::vector<Hit> hits(1);
  EXPECT_EQ(intersect(embree_, rays, Coherence::Coherent, hits), 1U);
}

TEST_F(RayStream, InactiveLanesAreNeitherTracedNorCounted) {
  std::vector<PathRay> rays(kPacket, ray({5, 9, 0}, {0, -1, 0}));
  rays[3].target = PathRay::kInactive;
  rays[3].origin = {kNan, kNan, kNan};
  std::vector<Hit> hits(rays.size());
  EXPECT_EQ(intersect(embree_, rays, Coherence::Coherent, hits), 0U);
  EXPECT_EQ(hits[3].geometry, Hit::kRefused);
  EXPECT_EQ(hits[4].geometry, 0U);
}

TEST_F(RayStream, AnyNumberOfRaysIsTraced) {
  for (const size_t count : {0U, 1U, 15U, 16U, 17U, 33U}) {
    const std::vector<PathRay> rays(count, ray({5, 9, 0}, {0, -1, 0}));
    std::vector<Hit> hits(count);
    EXPECT_EQ(intersect(embree_, rays, Coherence::Coherent, hits), 0U);
    for (const Hit& hit : hits) EXPECT_NEAR(hit.distance, 9.0, 1e-5);
  }
}

TEST_F(RayStream, LightArrivesUnlessSomethingIsInTheWay) {
  std::vector<double> light(4, 0.0);
  const std::vector<ShadowRay> rays = {
      {.origin = {0, 1, 0}, .direction = {0, 1, 0}, .distance = 9, .light = 1, .target = 0},
      {.origin = {0, 1, 0}, .direction = {0, 1, 0}, .distance = 0.5, .light = 2, .target = 1},
      {.origin = {5, 1, 0}, .direction = {0, 1, 0}, .distance = kInfinity, .light = 4, .target = 2},
      {.origin = {5, 1, 0},
       .direction = {0, -1, 0},
       .distance = kInfinity,
       .light = 8,
       .target = 3}};
  EXPECT_EQ(add_unshadowed(embree_, rays, light), 0U);
  EXPECT_EQ(light, (std::vector<double>{0, 2, 4, 0}));
}

}  // namespace
}  // namespace lenticule::render
