// SPDX-License-Identifier: Apache-2.0
// Tests that frames without a change are copied, and frames with any change are not.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "render/methods/method.h"
#include "render/methods/method_full.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

/// All inputs of one frame.
struct Shot {
  SceneDescription scene;
  test::TinyStage stage{};
  double near_mm = HUGE_VAL;  ///< nearest distance that is shown
  Surroundings surroundings{.background = {}, .environment_file = {}};
};

const optics::Rig& rig() {
  static const optics::Rig tiny = test::make_rig({.width = 60, .height = 40, .pixel_mm = 1.5});
  return tiny;
}

class Frames {
 public:
  explicit Frames(bool copy)
      : model_(rig()),
        method_(make_method("full", model_, {.copy_unchanged = copy, .cancelled = {}})) {}

  RenderStatistics render(const Shot& shot) {
    Stage stage = test::make_tiny_stage(shot.stage);
    stage.near_mm = std::min(stage.near_mm, shot.near_mm);
    const Scene scene(shot.scene, stage, shot.surroundings);
    frame = frames::WovenFrame(
        {rig().panel.width_px, rig().panel.height_px, frames::PixelFormat::Rgb8});
    return method_->render(scene, stage, frame);
  }
  frames::WovenFrame frame;

 private:
  optics::OpticalModel model_;
  std::unique_ptr<Method> method_;
};

frames::WovenFrame fresh(const Shot& shot) {
  Frames run(false);
  EXPECT_EQ(run.render(shot).copied_subpixels, 0U);
  return run.frame;
}

TEST(LastFrame, IsCopiedWhileNothingChanges) {
  for (const test::NamedScene& named : test::tiny_scenes()) {
    const Shot shot{.scene = named.scene};
    const frames::WovenFrame once = fresh(shot);
    Frames run(true);
    for (int n = 0; n < 3; ++n) {
      const RenderStatistics s = run.render(shot);
      EXPECT_TRUE(s.completed);
      EXPECT_EQ(s.copied_subpixels, n == 0 ? 0U : s.subpixels) << named.name;
      EXPECT_EQ(s.traced_subpixels + s.copied_subpixels, s.subpixels);
      EXPECT_EQ(run.frame, once) << named.name;
    }
  }
}

TEST(LastFrame, ACopyHasTheErrorsOfTheFrame) {
  const optics::OpticalModel model(test::make_rig({.width = 240, .height = 140}));
  const Stage stage = test::make_tiny_stage();
  const Scene scene(test::tiny_scenes().front().scene, stage, {});
  const auto method = make_method("adaptive", model, {.copy_unchanged = true, .cancelled = {}});
  frames::WovenFrame frame({240, 140});
  const RenderStatistics rendered = method->render(scene, stage, frame);
  const RenderStatistics copied = method->render(scene, stage, frame);
  ASSERT_EQ(copied.copied_subpixels, copied.subpixels);
  EXPECT_GT(rendered.rmse_bound, 0.0);
  EXPECT_EQ(copied.rmse_bound, rendered.rmse_bound);
  EXPECT_EQ(copied.beyond_bound, rendered.beyond_bound);
}

TEST(LastFrame, IsReusedOnlyOnRequest) {
  const Shot shot{.scene = test::tiny_scenes().front().scene};
  Frames run(false);
  run.render(shot);
  EXPECT_EQ(run.render(shot).copied_subpixels, 0U);
}

/// Returns a scene that shows every kind of object.
Shot all_kinds() {
  Shot shot;
  SceneDescription& scene = shot.scene;
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  scene.materials.push_back({.colour = {0.8, 0.5, 0.3}, .specular = 0.3, .shine = 8.0});
  scene.materials.push_back({.diffuse = 0.2, .transmittance = 0.7, .refraction_index = 1.4});
  auto texture = std::make_shared<Texture>(Texture{.width = 2, .height = 1});
  texture->rgba = {0.9F, 0.1F, 0.1F, 1.0F, 0.1F, 0.9F, 0.1F, 1.0F};
  scene.textures = {texture};
  scene.materials.push_back({.texture = 0});
  scene.meshes = {test::rectangle_mesh({-3, -2, -1}, {6, 0, 0}, {0, 4, 0}, 2)};
  scene.meshes.front().uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  scene.meshes.push_back(test::ball_mesh({-1.5, 0, 0}, 0.7, 6, 0));
  scene.spheres = {{.centre = {1, 0.5, 0.5}, .radius = 0.8, .material = 1}};
  scene.cones = {{.base = {1, -1.5, 0}, .base_radius = 0.6, .apex = {1, -0.5, 0}}};
  scene.lights = {{.kind = Light::Kind::Spot,
                   .position = {2, 3, 5},
                   .direction = {-0.3, -0.5, -0.8},
                   .cos_inner = 0.9,
                   .cos_outer = 0.5}};
  return shot;
}

const std::vector<std::function<void(Shot&)>>& changes() {
  static const std::vector<std::function<void(Shot&)>> list = {
      [](Shot& s) { s.scene.materials[0].colour.y += 0.3; },
      [](Shot& s) { s.scene.materials[0].diffuse = 0.6; },
      [](Shot& s) { s.scene.materials[0].specular = 0.7; },
      [](Shot& s) { s.scene.materials[0].shine = 2.0; },
      [](Shot& s) { s.scene.materials[0].emission.x = 0.4; },
      [](Shot& s) { s.scene.materials[0].tinted_specular = true; },
      [](Shot& s) { s.scene.materials[1].transmittance = 0.3; },
      [](Shot& s) { s.scene.materials[1].refraction_index = 1.1; },
      [](Shot& s) { s.scene.materials[2].texture = -1; },
      [](Shot& s) {
        auto other = std::make_shared<Texture>(*s.scene.textures[0]);
        other->rgba[0] = 0.2F;
        s.scene.textures = {other};
      },
      [](Shot& s) { s.scene.meshes[0].positions[1].x -= 1.5; },
      [](Shot& s) {
        s.scene.meshes[0].uvs[1] = {0.5F, 0.0F};
      },
      [](Shot& s) { s.scene.meshes[0].triangles.pop_back(); },
      [](Shot& s) { s.scene.meshes[0].material = 0; },
      [](Shot& s) { s.scene.meshes[1].normals.clear(); },
      [](Shot& s) { s.scene.spheres[0].centre.x -= 0.5; },
      [](Shot& s) { s.scene.spheres[0].radius = 0.5; },
      [](Shot& s) { s.scene.spheres[0].inward = true; },
      [](Shot& s) { s.scene.cones[0].apex_radius = 0.5; },
      [](Shot& s) { s.scene.cones[0].base_radius = 0.3; },
      [](Shot& s) { s.scene.lights[0].position.x = -3.0; },
      [](Shot& s) {
        s.scene.lights[0].direction = {0.0, -0.2, -1.0};
      },
      [](Shot& s) { s.scene.lights[0].colour.z = 0.2; },
      [](Shot& s) { s.scene.lights[0].kind = Light::Kind::Point; },
      [](Shot& s) { s.scene.lights[0].falls_off = true; },
      [](Shot& s) { s.scene.lights[0].cos_outer = 0.8; },
      [](Shot& s) { s.scene.lights[0].cos_inner = 0.99; },
      [](Shot& s) {
        s.scene.background = {0.4, 0.0, 0.1};
      },
      [](Shot& s) {
        s.scene.ambient = Vec3{0.3, 0.1, 0.1};
      },
      [](Shot& s) { s.scene.ambient.reset(); },
      [](Shot& s) { s.scene.colour_managed = false; },
      [](Shot& s) { s.stage.centre.y = 0.3; },
      [](Shot& s) { s.stage.mm_per_unit = 8.0; },
      [](Shot& s) { s.stage.depth_scale = 0.4; },
      [](Shot& s) { s.stage.turn_degrees = 10.0; },
      [](Shot& s) { s.near_mm = 4.0; },
      [](Shot& s) { s.surroundings.sky = true; },
      [](Shot& s) {
        s.surroundings.background = Vec3{0.0, 0.3, 0.3};
      },
      [](Shot& s) { s.surroundings.ground = true; },
  };
  return list;
}

TEST(LastFrame, IsNotCopiedIfAnythingChanges) {
  const Shot before = all_kinds();
  const frames::WovenFrame first = fresh(before);
  int visible = 0;
  for (size_t n = 0; n < changes().size(); ++n) {
    Frames run(true);
    run.render(before);
    Shot after = before;
    changes()[n](after);
    EXPECT_EQ(run.render(after).copied_subpixels, 0U) << "change " << n;
    const frames::WovenFrame expected = fresh(after);
    EXPECT_EQ(run.frame, expected) << "change " << n;
    visible += expected == first ? 0 : 1;
  }
  // Otherwise the scene could not show if a change matters.
  EXPECT_GE(visible, static_cast<int>(changes().size()) - 3);
}

}  // namespace
}  // namespace lenticule::render
