// SPDX-License-Identifier: Apache-2.0
// Tests that lights without a contribution are skipped and the bytes stay the same.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render/methods/method.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

Light spot(Vec3 from, Vec3 way, double half_degrees) {
  const double outer = half_degrees * 3.14159265358979 / 180.0;
  return {.kind = Light::Kind::Spot,
          .position = from,
          .direction = normalized(way),
          .colour = {0.9, 0.8, 0.7},
          .cos_inner = std::cos(0.7 * outer),
          .cos_outer = std::cos(outer)};
}

struct Rendered {
  frames::WovenFrame frame;
  RenderStatistics statistics;
};

Rendered rendered(const SceneDescription& description, IdleLights idle) {
  static const optics::Rig rig = test::make_rig({.width = 90, .height = 60, .pixel_mm = 1.0});
  const optics::OpticalModel model(rig);
  const Stage stage = test::make_tiny_stage();
  const Scene scene(description, stage, {}, 1, idle);
  Rendered out{frames::WovenFrame({90, 60, frames::PixelFormat::Rgb8}), {}};
  out.statistics = make_method("full", model, {.cancelled = {}})->render(scene, stage, out.frame);
  return out;
}

/// Returns the number of skipped lights and expects equal bytes.
uint64_t left_out(const SceneDescription& scene) {
  const Rendered without = rendered(scene, IdleLights::LeaveOut);
  const Rendered with = rendered(scene, IdleLights::Keep);
  EXPECT_EQ(without.frame, with.frame);
  EXPECT_EQ(without.statistics.shadow_rays, with.statistics.shadow_rays);
  EXPECT_EQ(with.statistics.lights_left_out, 0U);
  return without.statistics.lights_left_out;
}

TEST(IdleLights, AreSkipped) {
  for (const test::NamedScene& named : test::tiny_scenes()) {
    SCOPED_TRACE(named.name);
    SceneDescription scene = named.scene;
    scene.ambient = Vec3{0.1, 0.1, 0.1};
    scene.lights.insert(scene.lights.begin(),
                        {.kind = Light::Kind::Point, .position = {0, 3, 4}, .colour = {0, 0, 0}});
    scene.lights.insert(scene.lights.begin() + 1, spot({0, 0, 40}, {0, 0, 1}, 30.0));
    scene.lights.push_back(spot({0, 60, 0}, {1, 0, 0}, 40.0));
    EXPECT_EQ(left_out(scene), 3U);
  }
}

TEST(IdleLights, AreKeptIfTheyMightContribute) {
  SceneDescription scene = test::tiny_scenes().front().scene;
  scene.lights = {spot({0, 0, 40}, {0, 0, -1}, 5.0),      // shines on the scene
                  spot({0, 0, 0}, {0, 0, 1}, 5.0),        // is inside the scene
                  spot({0, 40, 0}, {0, -1, 0.3}, 20.0)};  // touches the rim of the scene
  scene.lights.push_back(
      {.kind = Light::Kind::Point, .position = {}, .colour = {0, 0, 0}, .falls_off = true});
  EXPECT_EQ(left_out(scene), 0U);
}

TEST(IdleLights, GiveTheSameBytesOnEverySide) {
  std::mt19937_64 random(9);
  std::normal_distribution<double> any(0.0, 1.0);
  uint64_t out = 0, lights = 0;
  for (int n = 0; n < 40; ++n) {
    SceneDescription scene = test::tiny_scenes()[static_cast<size_t>(n) % 5].scene;
    scene.lights.clear();
    for (int k = 0; k < 4; ++k) {
      const Vec3 from = normalized(Vec3{any(random), any(random), any(random)}) * (6.0 + 4.0 * k);
      const Vec3 way{any(random), any(random), any(random)};
      scene.lights.push_back(spot(from, way - from * 0.1, 10.0 + 15.0 * k));
      ++lights;
    }
    out += left_out(scene);
  }
  EXPECT_GT(out, lights / 10);
  EXPECT_LT(out, lights);
}

}  // namespace
}  // namespace lenticule::render
