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
    occluded16(packet.valid, scene_.embree, packet.rays.ray, Coherence::Incoherent);
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
    intersect16(packet.valid, scene_.embree, packet.rays, Coherence::Incoherent);
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
