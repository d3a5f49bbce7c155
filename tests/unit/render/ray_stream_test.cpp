// SPDX-License-Identifier: Apache-2.0
// Tests which rays reach Embree.
#include "render/accel/ray_stream.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>

#include "lab/stability/probes.h"
#include "render/scene/scene.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Returns a floor and a sphere above it, which are both kinds of geometry, in scene millimetres.
SceneDescription floor_and_sphere() {
  SceneDescription scene;
  scene.source = "test";
  scene.materials = {Material{}};
  scene.meshes = {test::rectangle_mesh({-9, 0, 9}, {18, 0, 0}, {0, 0, -18}, 0)};
  scene.spheres = {{.centre = {0, 3, 0}, .radius = 1}};
  return scene;
}

class RayStream : public ::testing::Test {
 protected:
  Scene scene_{floor_and_sphere(), test::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1};
  const EmbreeScene& embree_ = scene_.embree;
};

PathRay ray(Vec3 origin, Vec3 direction) {
  return {.origin = origin, .direction = direction, .target = 0};
}

std::vector<Vec3> unusable_vectors() {
  return {{kNan, 0, 0},       {0, kNan, 0}, {0, 0, kNan},  {kInfinity, 0, 0},
          {0, -kInfinity, 0}, {1e30, 0, 0}, {0, 0, 1e300}, {0, -1e18, 0}};
}

TEST_F(RayStream, NonFiniteRaysAreCountedAndNeverReachEmbree) {
  // Embree ends the process if it traces one of these.
  for (const Vec3 bad : unusable_vectors()) {
    const std::vector<PathRay> rays = {ray({0, 9, 0}, {0, -1, 0}), ray(bad, {0, -1, 0}),
                                       ray({5, 9, 0}, bad)};
    std::vector<Hit> hits(rays.size());
    for (const Coherence coherence : {Coherence::Coherent, Coherence::Incoherent}) {
      EXPECT_EQ(lab::intersect(embree_, rays, coherence, hits), 2U);
      EXPECT_EQ(hits[0].geometry, 1U);
      EXPECT_NEAR(hits[0].distance, 5.0, 1e-5);
      EXPECT_EQ(hits[1].geometry, Hit::kRefused);
      EXPECT_EQ(hits[2].geometry, Hit::kRefused);
    }
  }
}

TEST_F(RayStream, NonFiniteShadowRaysAddNothing) {
  std::vector<double> light(1, 0.0);
  for (const Vec3 bad : unusable_vectors()) {
    const std::vector<lab::ShadowRay> rays = {
        {.origin = bad, .direction = {0, 1, 0}, .distance = 1.0, .light = 1.0},
        {.origin = {5, 1, 0}, .direction = bad, .distance = 1.0, .light = 1.0},
        {.origin = {5, 1, 0}, .direction = {0, 1, 0}, .distance = kNan, .light = 1.0}};
    EXPECT_EQ(lab::add_unshadowed(embree_, rays, light), 3U);
    EXPECT_EQ(light[0], 0.0);
  }
}

TEST_F(RayStream, ARayWithoutDirectionIsRefused) {
  const std::vector<PathRay> rays = {ray({0, 9, 0}, {0, 0, 0})};
  std::vector<Hit> hits(1);
  EXPECT_EQ(lab::intersect(embree_, rays, Coherence::Coherent, hits), 1U);
}

TEST_F(RayStream, InactiveLanesAreNeitherTracedNorCounted) {
  std::vector<PathRay> rays(kPacket, ray({5, 9, 0}, {0, -1, 0}));
  rays[3].target = PathRay::kInactive;
  rays[3].origin = {kNan, kNan, kNan};
  std::vector<Hit> hits(rays.size());
  EXPECT_EQ(lab::intersect(embree_, rays, Coherence::Coherent, hits), 0U);
  EXPECT_EQ(hits[3].geometry, Hit::kRefused);
  EXPECT_EQ(hits[4].geometry, 0U);
}

TEST_F(RayStream, TracesAnyNumberOfRays) {
  for (const size_t count : {0U, 1U, 15U, 16U, 17U, 33U}) {
    const std::vector<PathRay> rays(count, ray({5, 9, 0}, {0, -1, 0}));
    std::vector<Hit> hits(count);
    EXPECT_EQ(lab::intersect(embree_, rays, Coherence::Coherent, hits), 0U);
    for (const Hit& hit : hits) EXPECT_NEAR(hit.distance, 9.0, 1e-5);
  }
}

TEST_F(RayStream, LightArrivesUnlessOccluded) {
  std::vector<double> light(4, 0.0);
  const std::vector<lab::ShadowRay> rays = {
      {.origin = {0, 1, 0}, .direction = {0, 1, 0}, .distance = 9, .light = 1, .target = 0},
      {.origin = {0, 1, 0}, .direction = {0, 1, 0}, .distance = 0.5, .light = 2, .target = 1},
      {.origin = {5, 1, 0}, .direction = {0, 1, 0}, .distance = kInfinity, .light = 4, .target = 2},
      {.origin = {5, 1, 0},
       .direction = {0, -1, 0},
       .distance = kInfinity,
       .light = 8,
       .target = 3}};
  EXPECT_EQ(lab::add_unshadowed(embree_, rays, light), 0U);
  EXPECT_EQ(light, (std::vector<double>{0, 2, 4, 0}));
}

/// Returns sixteen directions from the middle of a closed ball, all on one side of each axis; one
/// of them comes as close to the other side of an axis as `nearly` states.
std::vector<Vec3> directions_beside_an_axis(size_t axis, double nearly) {
  std::vector<Vec3> directions;
  for (int k = 0; k < static_cast<int>(kPacket); ++k) {
    const double aside = k == 5 ? nearly : -0.001 - 0.002 * k;
    const double other = -0.03 + 0.001 * k;
    if (axis == 0) directions.push_back(normalized(Vec3{aside, 1.0, other}));
    if (axis == 1) directions.push_back(normalized(Vec3{other, aside, 1.0}));
    if (axis == 2) directions.push_back(normalized(Vec3{1.0, other, aside}));
  }
  return directions;
}

class ClosedBall : public ::testing::TestWithParam<double> {
 protected:
  static SceneDescription ball() {
    SceneDescription scene;
    scene.source = "ball";
    scene.materials = {Material{}};
    scene.meshes = {test::ball_mesh({}, 40.0, 60, 0)};
    return scene;
  }
  Scene scene_{ball(), test::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1};
  const EmbreeScene& embree_ = scene_.embree;
};

// Embree treats these components as positive; beside negative ones, its bounds of the packet would
// hit nothing.
TEST_P(ClosedBall, StopsPacketsWithARayNearlyAlongAnAxis) {
  for (size_t axis = 0; axis < 3; ++axis) {
    std::vector<PathRay> rays;
    std::vector<lab::ShadowRay> shadows;
    for (const Vec3 way : directions_beside_an_axis(axis, GetParam())) {
      rays.push_back(ray({}, way));
      shadows.push_back({.origin = {}, .direction = way, .distance = 1e3, .light = 1.0});
    }
    std::vector<Hit> hits(rays.size());
    EXPECT_EQ(lab::intersect(embree_, rays, Coherence::Coherent, hits), 0U);
    for (const Hit& hit : hits) EXPECT_EQ(hit.geometry, 0U) << "axis " << axis;
    std::vector<double> light(1, 0.0);
    EXPECT_EQ(lab::add_unshadowed(embree_, shadows, light), 0U);
    EXPECT_EQ(light[0], 0.0) << "axis " << axis;
  }
}

INSTANTIATE_TEST_SUITE_P(Nearly, ClosedBall,
                         ::testing::Values(0.0, -0.0, 1e-30, -1e-30, -6.9e-19, -1.1e-18, -1e-12,
                                           1e-19, 1e-12, 1e-3));

/// A component of the valid lanes has one side if none is below zero, or if all are, by more than
/// 1e-17.
bool on_one_side_plainly(const int* valid, const float* components) {
  bool any_below = false, all_below = true, any_small = false;
  for (size_t r = 0; r < kPacket; ++r) {
    if (valid[r] == 0) continue;
    any_below |= components[r] < 0.0F;
    all_below &= std::signbit(components[r]);
    any_small |= std::abs(components[r]) < 1e-17F;
  }
  return !any_below || (all_below && !any_small);
}

TEST_F(RayStream, FindsTheOctantOfAnyPacket) {
  std::mt19937_64 random(5);
  const std::array numbers = {0.0F, -0.0F, 1e-30F, -1e-30F, 2e-17F, -2e-17F, 0.5F, -0.5F};
  int one_octant = 0;
  for (int round = 0; round < 20000; ++round) {
    alignas(64) int valid[kPacket];
    RTCRay16 rays{};
    const size_t mostly = random() % numbers.size();
    const uint64_t others = random() % 4;
    for (size_t r = 0; r < kPacket; ++r) {
      valid[r] = random() % 4 == 0 ? 0 : -1;
      const bool other = random() % kPacket < others;
      rays.dir_x[r] = numbers[other ? random() % numbers.size() : mostly];
      rays.dir_y[r] = 1.0F;
      rays.dir_z[r] = -1.0F;
    }
    const bool expected = on_one_side_plainly(valid, rays.dir_x);
    ASSERT_EQ(in_one_octant(valid, rays), expected) << "round " << round;
    one_octant += expected ? 1 : 0;
  }
  EXPECT_GT(one_octant, 4000);
  EXPECT_LT(one_octant, 16000);
}

/// Embree takes packets in the width of its vectors; rays hit the same for every width.
TEST_F(RayStream, PacketsOfAllWidthsHitTheSame) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  int met = 0;
  for (int round = 0; round < 400; ++round) {
    std::vector<PathRay> rays(kPacket);
    for (PathRay& one : rays)
      if (random() % 4 != 0)
        one = ray({any(random), 6.0 + any(random), any(random)},
                  normalized(Vec3{any(random), any(random) - 4.0, any(random)}));
    RayPacket packet;
    ASSERT_EQ(load_packet(rays, packet), 0U);
    for (const Coherence coherence : {Coherence::Coherent, Coherence::Incoherent}) {
      RayPacket widest = packet;
      intersect16(widest.valid, embree_, widest.rays, coherence, 16);
      for (const int width : {8, 4}) {
        RayPacket narrow = packet;
        RTCRay16 shadow = packet.rays.ray;
        intersect16(narrow.valid, embree_, narrow.rays, coherence, width);
        occluded16(narrow.valid, embree_, shadow, coherence, width);
        for (size_t r = 0; r < kPacket; ++r) {
          ASSERT_EQ(narrow.rays.hit.geomID[r], widest.rays.hit.geomID[r]) << width;
          ASSERT_EQ(narrow.rays.hit.primID[r], widest.rays.hit.primID[r]) << width;
          const bool meets = widest.rays.hit.geomID[r] != RTC_INVALID_GEOMETRY_ID;
          ASSERT_EQ(shadow.tfar[r] < 0.0F, meets) << width;
          if (!meets) continue;
          ASSERT_NEAR(narrow.rays.ray.tfar[r], widest.rays.ray.tfar[r], 1e-5F) << width;
          ++met;
        }
      }
    }
  }
  EXPECT_GT(met, 5000);
}

}  // namespace
}  // namespace lenticule::render
