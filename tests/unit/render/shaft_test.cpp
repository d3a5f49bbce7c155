// SPDX-License-Identifier: Apache-2.0
// Tests that shafts reported as empty are empty, and that enough of them are found.
#include "render/culling/shaft.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render/accel/ray_stream.h"
#include "render/shading/shading_tables.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

/// Returns a floor of 100 mm and a ball of 10 mm that hovers 30 mm above its middle.
SceneDescription ball_over_floor() {
  SceneDescription scene;
  scene.source = "test";
  scene.materials = {Material{}};
  scene.meshes = {test::rectangle_mesh({-50, 0, 50}, {100, 0, 0}, {0, 0, -100}, 0)};
  scene.spheres = {{.centre = {0, 30, 0}, .radius = 10}};
  return scene;
}

class BallOverFloor : public ::testing::Test {
 protected:
  [[nodiscard]] bool empty(const Shaft& shaft) const { return tester_.empty(shaft); }
  [[nodiscard]] bool blocked(const Shaft& shaft) const { return tester_.blocked(shaft); }

  /// Returns a cell of 1 mm around a place of the floor, seen from above.
  [[nodiscard]] Patch floor_patch(double x, double z) const {
    for (uint32_t triangle = 0; triangle < 2; ++triangle)
      for (int u = 0; u < 64; ++u)
        for (int v = 0; v + u < 64; ++v) {
          SurfaceCell cell{.geometry = 0, .primitive = triangle, .u = u, .v = v, .divisions = 64};
          Patch patch = patch_of(scene_, cell);
          if (patch.normal.y < 0) {
            cell.outer_side = false;
            patch = patch_of(scene_, cell);
          }
          if (std::hypot(patch.centre.x - x, patch.centre.z - z) < 1.5) return patch;
        }
    ADD_FAILURE() << "no cell at " << x << ", " << z;
    return {};
  }

  Scene scene_{ball_over_floor(), test::make_tiny_stage({.mm_per_unit = 1.0}), {}, 1};
  ShaftTester tester_{scene_, *scene_.tree};
};

constexpr float kCosine5Degrees = 0.99619F;

TEST_F(BallOverFloor, StraightUpIsOpenOnlyBesideTheBall) {
  EXPECT_TRUE(empty(shaft_in_cone(floor_patch(40, 0), {0, 1, 0}, kCosine5Degrees)));
  EXPECT_TRUE(empty(shaft_in_cone(floor_patch(-16, 5), {0, 1, 0}, kCosine5Degrees)));
  EXPECT_FALSE(empty(shaft_in_cone(floor_patch(9, 0), {0, 1, 0}, kCosine5Degrees)));
  EXPECT_FALSE(empty(shaft_in_cone(floor_patch(12, 0), {0, 1, 0}, kCosine5Degrees)));
}

TEST_F(BallOverFloor, ALightBeforeTheBallIsSeenAndOneBehindItIsNot) {
  EXPECT_TRUE(empty(shaft_to_point(floor_patch(0, 0), {0, 18, 0})));
  EXPECT_FALSE(empty(shaft_to_point(floor_patch(0, 0), {0, 45, 0})));
  EXPECT_TRUE(empty(shaft_to_point(floor_patch(30, 0), {0, 100, 0})));
}

TEST_F(BallOverFloor, ALightBehindTheBallIsBlockedInTheUmbra) {
  EXPECT_TRUE(blocked(shaft_to_point(floor_patch(0, 0), {0, 100, 0})));
  EXPECT_FALSE(blocked(shaft_to_point(floor_patch(0, 0), {0, 18, 0}))) << "before the ball";
  EXPECT_FALSE(blocked(shaft_to_point(floor_patch(0, 0), {0, 30, 0}))) << "in the ball";
  EXPECT_FALSE(blocked(shaft_to_point(floor_patch(30, 0), {0, 100, 0}))) << "beside the ball";
  EXPECT_FALSE(blocked(shaft_in_cone(floor_patch(0, 0), {0, 1, 0}, kCosine5Degrees)));
}

TEST_F(BallOverFloor, AnAreaLightIsBlockedWhereItIsWhollyBehindTheBall) {
  EXPECT_TRUE(blocked(shaft_to_ball(floor_patch(0, 0), {0, 100, 0}, 10)));
  EXPECT_FALSE(blocked(shaft_to_ball(floor_patch(0, 0), {0, 100, 0}, 40))) << "wider than the ball";
  EXPECT_FALSE(blocked(shaft_to_ball(floor_patch(0, 0), {0, 44, 0}, 5))) << "touches the ball";
  EXPECT_TRUE(empty(shaft_to_ball(floor_patch(30, 0), {30, 100, 0}, 10)));
  EXPECT_FALSE(empty(shaft_to_ball(floor_patch(30, 0), {30, 100, 0}, 75))) << "around the ball";
  EXPECT_FALSE(empty(shaft_to_ball(floor_patch(30, 0), {30, 5, 0}, 8))) << "sinks into the floor";
}

TEST_F(BallOverFloor, TheHemisphereIsOpenFarFromTheBall) {
  EXPECT_TRUE(empty(shaft_around(floor_patch(0, 0), 15)));
  EXPECT_FALSE(empty(shaft_around(floor_patch(0, 0), 25)));
  EXPECT_FALSE(empty(shaft_around(floor_patch(9, 0), 22)));
  EXPECT_TRUE(empty(shaft_around(floor_patch(40, 0), 22)));
  EXPECT_FALSE(blocked(shaft_around(floor_patch(0, 0), 25)));
}

TEST_F(BallOverFloor, TheFloorBlocksAnAreaLightBelowIt) {
  const Patch above{.centre = {5, 9, 5}, .radius = 1};
  EXPECT_TRUE(blocked(shaft_to_ball(above, {5, -100, 5}, 4)));
  EXPECT_FALSE(blocked(shaft_to_ball(above, {5, -100, 5}, 60))) << "seen past an edge";
  EXPECT_FALSE(blocked(shaft_to_ball(above, {5, -3, 5}, 4))) << "comes through the floor";
}

TEST_F(BallOverFloor, TheRimOfTheShadowIsUndecided) {
  const Vec3 light{0, 100, 0};
  int undecided = 0;
  for (float x = 0; x < 30; x += 0.25F) {
    const Shaft shaft = shaft_to_point(floor_patch(x, 0), light);
    EXPECT_FALSE(empty(shaft) && blocked(shaft));
    undecided += !empty(shaft) && !blocked(shaft) ? 1 : 0;
  }
  EXPECT_GT(undecided, 0);
  EXPECT_LT(undecided, 60);
}

TEST_F(BallOverFloor, TheFloorBlocksALightBelowIt) {
  Patch above{.centre = {5, 9, 5}, .radius = 1};
  EXPECT_TRUE(blocked(shaft_to_point(above, {5, -100, 5})));
  EXPECT_FALSE(blocked(shaft_to_point(above, {5, 100, 50})));
  above.centre.y = 0.5F;
  EXPECT_FALSE(blocked(shaft_to_point(above, {5, -100, 5}))) << "the patch reaches through it";
}

TEST_F(BallOverFloor, DirectionsIntoTheFloorAreNotOpen) {
  EXPECT_FALSE(empty(shaft_in_cone(floor_patch(40, 0), {0, -1, 0}, kCosine5Degrees)));
}

TEST_F(BallOverFloor, TheBallDoesNotOccludeItself) {
  const Patch top = patch_of(scene_, {.geometry = 1, .u = 4, .v = 7, .divisions = 8});
  const Vec3f outward = normalized(top.centre - Vec3f{0, 30, 0});
  ASSERT_GT(outward.y, 0.0F);
  EXPECT_TRUE(empty(shaft_in_cone(top, outward, kCosine5Degrees)));
  EXPECT_FALSE(empty(shaft_to_point(floor_patch(0, 0), Vec3(top.centre + outward))));
}

/// Every conservative result must hold for all rays that it covers.
class ShaftSoundness : public ::testing::TestWithParam<test::NamedScene> {
 protected:
  ShaftSoundness() : scene_(GetParam().scene, test::make_tiny_stage(), {}, 1) {}

  [[nodiscard]] ShaftResult result(const SurfaceCell& cell, uint64_t target,
                                   SoftSizes sizes = {}) const {
    return scene_.shaft_cache->with_sizes(sizes).result(
        cell, scene_.shaft_cache->number(cell.geometry, cell.primitive, place_of(cell)), target);
  }
  [[nodiscard]] bool blocked(Vec3f origin, Vec3f direction, float far) const {
    RayPacket packet;
    load_packet(
        std::vector<PathRay>{{.origin = Vec3(origin), .direction = Vec3(direction), .target = 0}},
        packet);
    packet.rays.ray.tfar[0] = far;
    occluded16(packet.valid, scene_.embree.get(), packet.rays.ray, Coherence::Incoherent);
    return packet.rays.ray.tfar[0] < 0.0F;
  }

  Scene scene_;
};

TEST_P(ShaftSoundness, HoldsForEveryRay) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const auto unit_vector = [&] { return normalized(Vec3{any(random), any(random), any(random)}); };
  int found_lit = 0, found_dark = 0, found_open = 0, asked = 0;
  int area_lights_lit = 0, area_lights_dark = 0, found_around = 0;
  for (int round = 0; round < 2000; ++round) {
    std::vector<PathRay> rays(kPacket);
    for (PathRay& ray : rays) {
      ray.origin = unit_vector() * 60.0;
      ray.direction = normalized(unit_vector() * 8.0 - ray.origin);
      ray.target = 0;
    }
    RayPacket packet;
    load_packet(rays, packet);
    intersect16(packet.valid, scene_.embree.get(), packet.rays, Coherence::Incoherent);
    shading_kernel::Surfaces s{};
    if (!isa_baseline::kShadingKernel.find_surfaces(scene_.shading->tables(),
                                                    &packet.rays.ray.org_x[0], packet.valid, s))
      continue;
    for (size_t r = 0; r < kPacket; ++r) {
      if (s.active[r] == 0) continue;
      const SurfaceCell cell = cell_of(packet.rays, s, r);
      const Vec3f start{s.start[0][r], s.start[1][r], s.start[2][r]};
      const Vec3f normal{s.geometric[0][r], s.geometric[1][r], s.geometric[2][r]};
      const Patch patch = patch_of(scene_, cell);
      EXPECT_LE(length(start - patch.centre), patch.radius);
      ++asked;
      for (size_t light = 0; light < scene_.lights.size(); ++light) {
        const SceneLight& area_light = scene_.lights[light];
        if (area_light.kind == Light::Kind::Directional) continue;
        const Vec3f way = Vec3f(area_light.position) - start;
        if (dot(way, normal) <= 0) continue;
        const ShaftResult known = result(cell, ShaftCache::light_target(light));
        if (known == ShaftResult::None) continue;
        ++(known == ShaftResult::Empty ? found_lit : found_dark);
        EXPECT_EQ(blocked(start, normalized(way), length(way)), known == ShaftResult::Blocked);
      }
      // A random point of an area light.
      for (size_t light = 0; light < scene_.lights.size(); ++light) {
        const SceneLight& area_light = scene_.lights[light];
        const SoftSizes sizes{.light_radius = round % 2 == 0 ? 3.0 : 14.0,
                              .sun_tangent = 0.05,
                              .around = round % 2 == 0 ? 4.0 : 9.0};
        const bool sun = area_light.kind == Light::Kind::Directional;
        const Vec3 middle = sun ? -area_light.direction : area_light.position;
        const Vec3 aside = unit_vector() * (sun ? sizes.sun_tangent : sizes.light_radius);
        const Vec3f way = sun ? Vec3f(middle + aside) : Vec3f(middle + aside) - start;
        if (dot(way, normal) <= 0 || (sun && std::abs(dot(aside, middle)) > 0.01)) continue;
        const ShaftResult known = result(cell, ShaftCache::light_target(light), sizes);
        if (known == ShaftResult::None) continue;
        ++(known == ShaftResult::Empty ? area_lights_lit : area_lights_dark);
        EXPECT_EQ(blocked(start, normalized(way),
                          sun ? std::numeric_limits<float>::infinity() : length(way)),
                  known == ShaftResult::Blocked);
      }
      // A random direction of the hemisphere, as low as directions may be.
      Vec3 low = unit_vector();
      low = normalized(low - Vec3(normal) * (dot(low, Vec3(normal)) - 1e-7));
      const SoftSizes around{.around = round % 2 == 0 ? 4.0 : 9.0};
      if (result(cell, ShaftCache::kAround, around) == ShaftResult::Empty) {
        ++found_around;
        EXPECT_FALSE(blocked(start, Vec3f(low), static_cast<float>(around.around)));
        const Vec3 steep = unit_vector();
        EXPECT_FALSE(blocked(start, Vec3f(dot(steep, Vec3(normal)) < 0.0 ? -steep : steep),
                             static_cast<float>(around.around)));
      }
      // A random direction in a bin above the surface.
      Vec3f direction(unit_vector());
      if (dot(direction, normal) < 0) direction = -direction;
      const float sum = std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z);
      float x = direction.x / sum, y = direction.y / sum;
      if (direction.z < 0) {
        const float folded = std::copysign(1.0F - std::abs(y), x);
        y = std::copysign(1.0F - std::abs(x), y);
        x = folded;
      }
      const auto bin = [](float at) {
        return std::min(kDirectionBins - 1, static_cast<int>((at + 1.0F) * 0.5F * kDirectionBins));
      };
      const ShaftResult known = result(cell, ShaftCache::direction_target(bin(x), bin(y)));
      ASSERT_NE(known, ShaftResult::Blocked);
      if (known == ShaftResult::None) continue;
      ++found_open;
      EXPECT_FALSE(blocked(start, direction, std::numeric_limits<float>::infinity()));
    }
    ASSERT_FALSE(HasFailure()) << "round " << round;
  }
  EXPECT_GT(asked, 1000);
  EXPECT_GT(found_open, asked / 20);
  EXPECT_GT(area_lights_lit, asked / 50);
  EXPECT_GT(found_around, asked / 50);
  std::printf(
      "%s: %d places, %d proved lit, %d in shadow, %d open; of lamps %d and %d; %d with nothing "
      "around\n",
      GetParam().name.c_str(), asked, found_lit, found_dark, found_open, area_lights_lit,
      area_lights_dark, found_around);
}

INSTANTIATE_TEST_SUITE_P(TinyScenes, ShaftSoundness, ::testing::ValuesIn(test::tiny_scenes()),
                         [](const auto& scene) { return scene.param.name; });

}  // namespace
}  // namespace lenticule::render
