// SPDX-License-Identifier: Apache-2.0
// Tests that copying unchanged regions of the frame before does not change a byte.
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "render/methods/method.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

optics::Rig wide_rig() { return make_rig({.width = 400, .height = 240, .pixel_mm = 0.2}); }

/// Returns a floor, a wall, and balls, boxes and cones in front of it; matte except for a share
/// `shiny` of them.
SceneDescription strewn(std::mt19937_64& random, double shiny, int of_each = 5) {
  std::uniform_real_distribution<double> any(-1.0, 1.0), part(0.0, 1.0);
  SceneDescription scene;
  scene.background = {0.1, 0.2, 0.4};
  scene.ambient = {0.2, 0.2, 0.2};
  scene.colour_managed = false;
  scene.materials = {Material{.colour = {0.9, 0.8, 0.7}, .diffuse = 0.8},
                     Material{.colour = {0.3, 0.7, 0.5}, .diffuse = 0.9},
                     Material{.colour = {0.7, 0.7, 0.8}, .diffuse = 0.5, .specular = 0.4}};
  const auto material = [&] { return part(random) < shiny ? 2 : part(random) < 0.5 ? 1 : 0; };
  scene.meshes = {test::rectangle_mesh({-4, -2, -2}, {0, 0, 4}, {8, 0, 0}, 0),
                  test::rectangle_mesh({-4, -2, -2}, {8, 0, 0}, {0, 5, 0}, 1)};
  for (int n = 0; n < of_each; ++n) {
    const Vec3 at{3.5 * any(random), 1.8 * any(random), 1.2 * any(random)};
    const double size = 0.1 + 0.3 * part(random);
    scene.spheres.push_back({.centre = at, .radius = size, .material = material()});
    const Vec3 low{3.5 * any(random), 1.8 * any(random), 1.2 * any(random)};
    scene.meshes.push_back(test::box_mesh(low, low + Vec3{size, size, size}, material()));
    scene.cones.push_back({.base = low + Vec3{0.5, 0, 0},
                           .base_radius = 0.5 * size,
                           .apex = low + Vec3{0.5, size, 0.2},
                           .apex_radius = 0.1 * size,
                           .material = material()});
  }
  scene.lights = {Light{.position = {6 * any(random), 9, 6}, .colour = {0.7, 0.7, 0.7}},
                  Light{.kind = Light::Kind::Directional,
                        .direction = normalized(Vec3{any(random), -1.5, -1.0}),
                        .colour = {0.4, 0.4, 0.5}}};
  return scene;
}

/// Adds grain finer than the samples to the wall, increasing with the height up to `most` at the
/// top. Strong grain makes bands be retraced.
void add_grain(SceneDescription& scene, float most, std::mt19937_64& random) {
  constexpr int kSize = 256;
  std::uniform_real_distribution<float> any(-0.5F, 0.5F);
  auto grain = std::make_shared<Texture>();
  grain->width = grain->height = kSize;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      const float grey = 0.5F + most * any(random) * static_cast<float>(kSize - row) / kSize;
      grain->rgba.insert(grain->rgba.end(), {grey, grey, grey, 1.0F});
    }
  scene.textures = {grain};
  scene.materials.push_back(Material{.colour = {1.0, 1.0, 1.0}, .diffuse = 0.9, .texture = 0});
  TriangleMesh& wall = scene.meshes[1];
  wall.material = static_cast<int>(scene.materials.size()) - 1;
  for (const Vec3& p : wall.positions)
    wall.uvs.push_back(
        {static_cast<float>((p.x + 4.0) / 8.0), static_cast<float>(1.0 - (p.y + 2.0) / 5.0)});
}

/// Moves or changes one or two objects.
void stir(SceneDescription& scene, std::mt19937_64& random) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  const Vec3 by{0.4 * any(random), 0.3 * any(random), 0.3 * any(random)};
  const auto one_of = [&](const auto& objects) { return random() % objects.size(); };
  switch (random() % 3) {
    case 0: {
      const size_t n = one_of(scene.spheres);
      scene.spheres[n].centre = scene.spheres[n].centre + by;
      break;
    }
    case 1: {
      TriangleMesh& mesh = scene.meshes[2 + random() % (scene.meshes.size() - 2)];
      for (Vec3& p : mesh.positions) p = p + by;
      break;
    }
    default:
      scene.cones[one_of(scene.cones)].material = 1;
  }
}

class Frames {
 public:
  Frames(const std::string& method, RenderOptions options)
      : threads_(options.threads),
        model_(rig_),
        method_(make_method(method, model_, keeping(std::move(options)))) {}

  frames::WovenFrame render(const SceneDescription& description) {
    // Embree limits the threads of the process to those that commit the scene.
    const Scene scene(description, stage_, {}, threads_);
    frames::WovenFrame frame({rig_.panel.width_px, rig_.panel.height_px});
    statistics = method_->render(scene, stage_, frame);
    return frame;
  }
  RenderStatistics statistics;

 private:
  static RenderOptions keeping(RenderOptions options) {
    options.copy_unchanged = true;
    return options;
  }
  int threads_;
  optics::Rig rig_ = wide_rig();
  optics::OpticalModel model_;
  Stage stage_ = make_tiny_stage();
  std::unique_ptr<Method> method_;
};

struct Scenario {
  double shiny;
  float grain;
  int of_each;
  double error;
  int frames;
  uint32_t seed;
};

/// Renders frames with moving objects and expects the bytes of frames rendered alone and with any
/// number of threads, and equal audit figures. Returns the number of retraced subpixels.
uint64_t expect_no_byte_changes(const Scenario& scenario, const SoftLight& soft) {
  SCOPED_TRACE(::testing::Message() << "seed " << scenario.seed);
  std::mt19937_64 random(scenario.seed);
  SceneDescription description = strewn(random, scenario.shiny, scenario.of_each);
  if (scenario.grain > 0.0F) add_grain(description, scenario.grain, random);
  const RenderOptions options{
      .threads = 1, .soft = soft, .tolerated_error = scenario.error, .cancelled = {}};
  Frames one("adaptive", options);
  RenderOptions other_options = options;
  other_options.threads = 3;
  other_options.tiles_backwards = true;
  Frames three("adaptive", other_options);
  uint64_t copied = 0, all = 0, retraced = 0;
  for (int n = 0; n < scenario.frames; ++n) {
    if (n > 0) stir(description, random);
    const frames::WovenFrame frame = one.render(description);
    EXPECT_EQ(frame, three.render(description)) << n;
    Frames alone("adaptive", options);
    EXPECT_EQ(frame, alone.render(description)) << n;
    const RenderStatistics& said = one.statistics;
    copied += said.copied_subpixels;
    all += said.subpixels;
    retraced += said.retraced_subpixels;
    if (said.copied_subpixels == said.subpixels) continue;  // nothing changed
    EXPECT_EQ(said.audited_subpixels, alone.statistics.audited_subpixels) << n;
    EXPECT_EQ(said.audited_beyond, alone.statistics.audited_beyond) << n;
    EXPECT_EQ(said.retraced_subpixels, alone.statistics.retraced_subpixels) << n;
    EXPECT_EQ(said.subpixels,
              said.copied_subpixels + said.traced_subpixels + said.interpolated_subpixels);
  }
  EXPECT_GT(copied, all / 50);
  return retraced;
}

TEST(UnchangedRegions, DoNotChangeTheBytesOfMethodAdaptive) {
  uint64_t retraced = 0;
  for (const Scenario& scenario :
       {Scenario{0.0, 0.0F, 5, 2.0, 8, 5}, Scenario{0.3, 0.0F, 16, 2.0, 8, 6},
        Scenario{0.2, 1.0F, 9, 2.0, 20, 7}, Scenario{0.0, 0.03F, 9, 2.0, 20, 8}})
    retraced += expect_no_byte_changes(scenario, {});
  EXPECT_GT(retraced, 0U);
}

TEST(UnchangedRegions, DoNotChangeTheBytesOfSoftLight) {
  expect_no_byte_changes({0.2, 0.0F, 8, 2.0, 6, 9}, {.shadow_samples = 4,
                                                     .light_radius_mm = 25.0,
                                                     .sun_radius_degrees = 5.0,
                                                     .occlusion_samples = 4,
                                                     .occlusion_distance_mm = 4.0});
}

/// Rays start in front of the nearest object. If it moves, their origins round differently, and so
/// do colours far from it.
TEST(UnchangedRegions, AreNoneIfTheNearestObjectMoves) {
  std::mt19937_64 random(10);
  SceneDescription description = strewn(random, 0.0);
  add_grain(description, 0.05F, random);
  description.meshes.erase(description.meshes.begin());  // the floor would be the nearest object
  const RenderOptions options{.threads = 1, .cancelled = {}};
  Frames frames("adaptive", options);
  for (int n = 0; n < 8; ++n) {
    description.spheres.front().centre = {2.8, 1.5, 2.0 - 0.031 * n};
    const frames::WovenFrame frame = frames.render(description);
    EXPECT_EQ(frame, Frames("adaptive", options).render(description)) << n;
  }
}

}  // namespace
}  // namespace lenticule::render
