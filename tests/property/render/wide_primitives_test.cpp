// SPDX-License-Identifier: Apache-2.0
// Tests that grounds up to the horizon and planets do not change the objects that stand on them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "render/accel/primitives.h"
#include "render/methods/method.h"
#include "tests/support/instruction_sets.h"
#include "tests/support/oracles/reference_renderer.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;
using test::NamedScene;

constexpr double kMmPerUnit = 50.0;

Stage stage_of(double turn_degrees = 12.5) {
  return make_tiny_stage({.mm_per_unit = kMmPerUnit, .turn_degrees = turn_degrees});
}

optics::Rig rig_of(int width, int height) {
  return make_rig({.width = width, .height = height, .pixel_mm = 360.0 / width});
}

frames::WovenFrame rendered(const SceneDescription& description, const optics::Rig& rig,
                            const Stage& stage = stage_of(), const RenderOptions& options = {},
                            const std::string& method = "full") {
  const optics::OpticalModel model(rig);
  const Scene scene(description, stage, {}, options.threads);
  frames::WovenFrame frame({rig.panel.width_px, rig.panel.height_px});
  EXPECT_TRUE(make_method(method, model, options)->render(scene, stage, frame).completed);
  return frame;
}

struct Materials {
  double ground_specular = 0.0;
  double ball_specular = 0.2;
  double ball_transmittance = 0.0;
};

/// Returns two balls, one of them of triangles, and a rod that stand on y = -1 before an area
/// light, in a dome that hides the ends of grounds.
SceneDescription objects(const Materials& of) {
  SceneDescription scene;
  scene.background = {0.1, 0.2, 0.4};
  scene.colour_managed = false;
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  scene.lights = {{.position = {5, 5, 5}, .colour = {0.9, 0.9, 0.9}}};
  scene.materials = {{.colour = {0.3, 0.8, 0.3}, .diffuse = 0.8, .specular = of.ground_specular},
                     {.colour = {1.0, 0.4, 0.2},
                      .diffuse = 0.6,
                      .specular = of.ball_specular,
                      .transmittance = of.ball_transmittance,
                      .refraction_index = 1.5},
                     {.colour = {0.4, 0.5, 0.9}, .diffuse = 0.7}};
  scene.spheres = {{.centre = {0.3, 0, 0}, .radius = 1.0, .material = 1},
                   {.centre = {0, 0, 0}, .radius = 19.0, .inward = true, .material = 2}};
  scene.meshes = {test::ball_mesh({2, -0.3, -1}, 0.7, 8, 1)};
  scene.cones = {{.base = {-1.7, -1, 0.2},
                  .base_radius = 0.2,
                  .apex = {-1.5, 0.6, 0},
                  .apex_radius = 0.1,
                  .material = 1}};
  return scene;
}

SceneDescription on_square(SceneDescription scene, double half_size, double height = -1.0) {
  scene.meshes.push_back(test::rectangle_mesh(
      {-half_size, height, half_size}, {2.0 * half_size, 0, 0}, {0, 0, -2.0 * half_size}, 0));
  return scene;
}

int most_apart(const frames::WovenFrame& a, const frames::WovenFrame& b) {
  int most = 0;
  for (size_t n = 0; n < a.bytes().size(); ++n)
    most = std::max(most, std::abs(int{a.bytes()[n]} - int{b.bytes()[n]}));
  return most;
}

const Materials kKinds[] = {
    {},
    {.ground_specular = 0.5, .ball_specular = 0.6},
    {.ground_specular = 0.2, .ball_specular = 0.2, .ball_transmittance = 0.7},
};

TEST(WidePrimitives, AGroundOfAnySizeGivesTheSamePicture) {
  const optics::Rig rig = rig_of(96, 64);
  for (const Materials& kind : kKinds)
    for (const double turn : {0.0, 12.5}) {
      const frames::WovenFrame first = rendered(on_square(objects(kind), 1e2), rig, stage_of(turn));
      for (const double half_size : {1e3, 1e4, 1e5, 1e6, 1e7})
        EXPECT_LE(
            most_apart(first, rendered(on_square(objects(kind), half_size), rig, stage_of(turn))),
            1)
            << half_size << ", turned by " << turn << ", specular " << kind.ground_specular;
    }
}

TEST(WidePrimitives, AHugeWallIsMirroredCorrectly) {
  const optics::Rig rig = rig_of(96, 64);
  const auto between_walls = [](double half_size) {
    SceneDescription scene = on_square(objects(kKinds[1]), half_size);
    scene.meshes.push_back(test::rectangle_mesh({-half_size, -half_size, -4 - 0.01 * half_size},
                                                {2.0 * half_size, 0, 0.02 * half_size},
                                                {0, 2.0 * half_size, 0}, 1));
    return scene;
  };
  const frames::WovenFrame first = rendered(between_walls(1e2), rig);
  for (const double half_size : {1e4, 1e6})
    EXPECT_LE(most_apart(first, rendered(between_walls(half_size), rig)), 1) << half_size;
}

TEST(WidePrimitives, EveryInstructionSetGivesTheSameBytes) {
  const optics::Rig rig = rig_of(96, 64);
  SceneDescription scene = on_square(objects(kKinds[2]), 1e6);
  scene.spheres.push_back({.centre = {0, 5e5, -5e5}, .radius = 7.0710e5, .material = 0});
  scene.cones.push_back({.base = {-1e5, 2e4, -9e4},
                         .base_radius = 9e4,
                         .apex = {1e5, 2e4, -9e4},
                         .apex_radius = 8.8e4,
                         .material = 0});
  const frames::WovenFrame one =
      rendered(scene, rig, stage_of(), {.threads = 1, .isa = Isa::Baseline, .cancelled = {}});
  for (const Isa isa : test::every_instruction_set())
    EXPECT_EQ(one, rendered(scene, rig, stage_of(), {.threads = 2, .isa = isa, .cancelled = {}}));
}

/// Adaptive frames interpolate a ground between samples, which needs a precise position of the
/// ground.
TEST(WidePrimitives, AdaptiveFramesAreAsCloseOnAGroundOfAnySize) {
  const optics::Rig rig = make_rig({.width = 400, .height = 240, .pixel_mm = 0.9});
  const auto beyond = [&](double half_size) {
    const SceneDescription scene = on_square(objects(kKinds[0]), half_size);
    const frames::WovenFrame full = rendered(scene, rig);
    const frames::WovenFrame adaptive = rendered(scene, rig, stage_of(), {}, "adaptive");
    size_t off = 0;
    for (size_t n = 0; n < full.bytes().size(); ++n)
      off += std::abs(int{full.bytes()[n]} - int{adaptive.bytes()[n]}) > 2 ? 1 : 0;
    return static_cast<double>(off) / static_cast<double>(full.bytes().size());
  };
  const double near = beyond(1e2);
  EXPECT_LT(near, 0.02);
  EXPECT_LT(beyond(1e6), 1.5 * near + 0.001);
}

/// Returns true if the reference gives the rendered colour at a place that is hardly different.
bool lies_on_an_edge(const SceneDescription& scene, const Stage& stage,
                     const optics::OpticalModel& model, int i, int j, int channel, int rendered) {
  for (const double x : {-1e-2, 0.0, 1e-2})
    for (const double y : {-1e-2, 0.0, 1e-2}) {
      const double value = test::reference_subpixel(scene, stage, model, i, j, channel,
                                                    {.move_x_mm = x, .move_y_mm = y});
      if (std::abs(value - rendered) <= 1.0) return true;
    }
  return false;
}

/// Expects subpixels that differ by more than one code value to lie on an edge; a quarter of a
/// percent is allowed.
int expect_as_the_oracle_says(const SceneDescription& scene, const std::string& name) {
  const optics::Rig rig = rig_of(48, 32);
  const Stage stage = stage_of();
  const optics::OpticalModel model(rig);
  const frames::WovenFrame frame = rendered(scene, rig, stage);
  int on_edges = 0;
  for (int j = 0; j < frame.height(); ++j)
    for (int i = 0; i < frame.width(); ++i)
      for (int channel = 0; channel < 3; ++channel) {
        const int code = frame.row(j)[3 * i + channel];
        const double expected = test::reference_subpixel(scene, stage, model, i, j, channel);
        if (std::abs(expected - code) <= 1.0) continue;
        ++on_edges;
        EXPECT_TRUE(lies_on_an_edge(scene, stage, model, i, j, channel, code))
            << name << " subpixel " << i << ", " << j << ", " << channel << ": oracle " << expected
            << ", full " << code;
      }
  EXPECT_LE(on_edges, 3 * frame.width() * frame.height() / 400) << name;
  return on_edges;
}

TEST(WidePrimitives, LargeShapesAgreeWithTheReference) {
  for (const Materials& kind : kKinds) {
    const SceneDescription on_it = objects(kind);
    for (const double size : {1e2, 1e6}) {
      const std::string of_size = " of " + std::to_string(size);
      expect_as_the_oracle_says(on_square(on_it, size), "square" + of_size);
      SceneDescription planet = on_it;
      planet.spheres.push_back({.centre = {0, -1.0 - size, 0}, .radius = size, .material = 0});
      expect_as_the_oracle_says(planet, "sphere" + of_size);
      SceneDescription inside = on_it;
      inside.spheres.push_back(
          {.centre = {0, size - 1.0, 0}, .radius = size, .inward = true, .material = 0});
      expect_as_the_oracle_says(inside, "inside of a sphere" + of_size);
      SceneDescription pipe = on_it;
      pipe.cones.push_back({.base = {-size, -1.0 - size, 0},
                            .base_radius = size,
                            .apex = {size, -1.0 - size, 0},
                            .apex_radius = size,
                            .material = 0});
      expect_as_the_oracle_says(pipe, "cylinder" + of_size);
      SceneDescription cone = on_it;
      cone.cones.push_back({.base = {0, -1.2 - 0.5 * size, -0.5 * size},
                            .base_radius = 0.55 * size,
                            .apex = {0, -1.2 - 0.5 * size, 0.5 * size},
                            .apex_radius = 0.45 * size,
                            .material = 0});
      expect_as_the_oracle_says(cone, "cone" + of_size);
    }
  }
}

/// Around each corner lie triangles of all widths, side by side.
TEST(WidePrimitives, NoRaySlipsBetweenWideAndNarrowTriangles) {
  SceneDescription scene;
  scene.background = {1, 0, 0};
  scene.colour_managed = false;
  scene.ambient = Vec3{1, 1, 1};
  scene.materials = {{.colour = {0, 0, 1}, .diffuse = 1.0}};
  constexpr uint32_t kCorners = 192;
  TriangleMesh fan;
  fan.positions = {{0.1, 0.05, -1.0}};
  for (uint32_t n = 0; n < kCorners; ++n) {
    const double angle = 2.0 * 3.14159265358979 * n / kCorners;
    const double reach = 10.0 * std::pow(10.0, n % 6);
    fan.positions.push_back(fan.positions[0] +
                            Vec3{std::cos(angle), std::sin(angle), 0.3 * std::cos(angle)} * reach);
    fan.triangles.push_back({0, 1 + n, 1 + (n + 1) % kCorners});
  }
  scene.meshes = {fan};
  for (const double turn : {0.0, 12.5, 41.0}) {
    const frames::WovenFrame frame = rendered(scene, rig_of(480, 320), stage_of(turn));
    size_t red = 0, blue = 0;
    for (size_t n = 0; n < frame.bytes().size(); n += 3) {
      red += frame.bytes()[n] > 0 ? 1 : 0;
      blue += frame.bytes()[n + 2] > 0 ? 1 : 0;
    }
    EXPECT_EQ(red, 0U) << turn;
    EXPECT_EQ(blue, frame.bytes().size() / 3) << turn;
  }
}

TEST(WidePrimitives, AreWiderThanTheirDistance) {
  const auto triangle = [](double size, Vec3 at) {
    return std::array<Vec3, 3>{at, at + Vec3{size, 0, 0}, at + Vec3{0, size, 0}};
  };
  EXPECT_FALSE(is_wide(triangle(kWidest, {0, 0, 0})));
  EXPECT_TRUE(is_wide(triangle(1.1 * kWidest, {0, 0, 0})));
  EXPECT_TRUE(is_wide(triangle(1.1 * kWidest, {0, 0, kWidest})));
  EXPECT_FALSE(is_wide(triangle(1.1 * kWidest, {0, 0, 2.0 * kWidest})));
  EXPECT_FALSE(is_wide(triangle(1.1 * kWidest, {-4.0 * kWidest, 0, 0})));
  const std::array<Vec3, 3> without_area = {Vec3{0, 0, 0}, Vec3{1e5, 0, 0}, Vec3{2e5, 0, 0}};
  EXPECT_FALSE(is_wide(without_area));
}

}  // namespace
}  // namespace lenticule::render
