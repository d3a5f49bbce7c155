// SPDX-License-Identifier: Apache-2.0
// Tests that scenes which are kept from frame to frame equal new ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "render/methods/method.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr int kFrames = 6;

/// Tiny scenes, one lit by the sun that depends on the viewer, and metallic ones in the light of
/// the studio and of their own lights.
std::vector<test::NamedScene> scenes() {
  std::vector<test::NamedScene> all = test::tiny_scenes();
  const test::NamedScene meshes = *std::ranges::find(all, "meshes", &test::NamedScene::name);
  const auto add = [&](const char* name, bool metallic, bool lit) {
    test::NamedScene& added = all.emplace_back(meshes);
    added.name = name;
    if (metallic)
      added.scene.materials[1].pbr = std::make_shared<PbrMaterial>(
          PbrMaterial{.base_colour_texture = {.texture = 0}, .metallic = 0.7, .roughness = 0.3});
    if (lit) return;
    added.scene.lights.clear();
    added.scene.ambient.reset();
  };
  add("sun", false, false);
  add("metallic", true, true);
  add("studio", true, false);
  return all;
}

/// A turn with a small move.
Stage stage_of(int frame) {
  return test::make_tiny_stage(
      {.centre = {0.2 * frame, 0.1, 0.0}, .depth_scale = 0.8, .turn_degrees = 11.0 * frame - 20.0});
}

class Renderer {
 public:
  frames::WovenFrame operator()(const char* method, const Scene& scene, const Stage& stage) const {
    frames::WovenFrame frame({rig_.panel.width_px, rig_.panel.height_px});
    EXPECT_TRUE(make_method(method, model_, {.threads = 1, .cancelled = {}})
                    ->render(scene, stage, frame)
                    .completed);
    return frame;
  }

 private:
  optics::Rig rig_ = test::make_rig({.width = 60, .height = 40, .pixel_mm = 1.0});
  optics::OpticalModel model_{rig_};
};

TEST(SceneKeeper, FramesHaveTheBytesOfNewScenes) {
  const Renderer render;
  const Surroundings plain;
  const Surroundings outdoors{
      .background = {}, .sky = true, .environment_file = {}, .ground = true};
  for (const test::NamedScene& named : scenes())
    for (const Surroundings& surroundings : {plain, outdoors}) {
      SceneKeeper keeper(surroundings, 1);
      const auto description = std::make_shared<const SceneDescription>(named.scene);
      for (int n = 0; n < kFrames; ++n) {
        const Stage stage = stage_of(n);
        // A description that is only equal is as good as the same one.
        const Scene& kept = keeper.commit(
            n == 3 ? std::make_shared<const SceneDescription>(named.scene) : description, stage);
        const Scene fresh(named.scene, stage, surroundings, 1);
        EXPECT_EQ(kept.near_mm, fresh.near_mm);
        EXPECT_EQ(kept.content, fresh.content);
        EXPECT_EQ(kept.picture, fresh.picture);
        for (const char* method : {"full", "adaptive", "lens-view"})
          EXPECT_EQ(render(method, kept, stage), render(method, fresh, stage))
              << named.name << ' ' << method << ' ' << n;
      }
    }
}

TEST(SceneKeeper, ShowsEveryChangeOfTheDescription) {
  const Renderer render;
  SceneKeeper keeper({}, 1);
  const Stage stage = stage_of(2);
  SceneDescription scene = test::tiny_scenes().front().scene;
  frames::WovenFrame last =
      render("full", keeper.commit(std::make_shared<const SceneDescription>(scene), stage), stage);
  for (int n = 0; n < 3; ++n) {
    scene.background.x += 0.2;
    const auto changed = std::make_shared<const SceneDescription>(scene);
    const frames::WovenFrame now = render("full", keeper.commit(changed, stage), stage);
    EXPECT_EQ(now, render("full", Scene(scene, stage, {}, 1), stage));
    EXPECT_NE(now, last);
    last = now;
  }
}

TEST(ScenePlace, KeepsTheFrameWhileTheStageTurnsAndMovesLittle) {
  const SceneDescription scene = test::tiny_scenes().front().scene;
  const test::TinyStage home{.centre = {10.0, 0.0, -7.0}, .mm_per_unit = 9.0};
  Scene committed(scene, test::make_tiny_stage(home), {}, 1);
  const Vec3 position = committed.meshes.empty() ? Vec3{} : Vec3(committed.meshes[0].positions[0]);
  const auto placed = [&](test::TinyStage stage) {
    return committed.place(scene, test::make_tiny_stage(stage), {});
  };
  for (int degrees = -360; degrees < 360; degrees += 7) {
    test::TinyStage turned = home;
    turned.turn_degrees = degrees;
    turned.depth_scale = 0.5 + 0.001 * degrees * (degrees > 0 ? 1 : 0);
    EXPECT_TRUE(placed(turned)) << degrees;
  }
  test::TinyStage other = home;
  other.centre.x += 5.0;  // 45 mm on the panel
  EXPECT_TRUE(placed(other));
  other.centre.x += 150.0;  // 1.35 m
  EXPECT_FALSE(placed(other));
  other = home;
  for (const double scale : {0.7, 0.9999, 1.25}) {
    other.mm_per_unit = scale * home.mm_per_unit;
    EXPECT_TRUE(placed(other)) << scale;
    EXPECT_DOUBLE_EQ(length(committed.scene_from_panel.column_x), 8.0 / other.mm_per_unit);
  }
  other.mm_per_unit = 2.0 * home.mm_per_unit;
  EXPECT_FALSE(placed(other));
  EXPECT_EQ(committed.frame.origin, Scene(scene, test::make_tiny_stage(home), {}, 1).frame.origin);
  EXPECT_EQ(committed.meshes.empty() ? Vec3{} : Vec3(committed.meshes[0].positions[0]), position);
}

TEST(ScenePlace, TheOriginOfTheFrameLiesWithinHalfAMetreOfThePanelsCentre) {
  for (const double unit : {1e-6, 0.37, 1.0, 1e5})
    for (int n = -30; n < 30; ++n) {
      const Vec3 centre{0.31 * n * unit, 1e4 * n * unit, -77.7 * unit};
      const Stage stage = test::make_tiny_stage({.centre = centre, .mm_per_unit = 900.0 / unit});
      const Scene scene(SceneDescription{}, stage, {}, 1);
      EXPECT_LT(largest_size(scene.scene_from_panel.origin) / scene.units_per_mm, 500.0)
          << centre.x;
    }
}

}  // namespace
}  // namespace lenticule::render
