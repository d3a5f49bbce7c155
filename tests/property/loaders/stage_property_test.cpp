// SPDX-License-Identifier: Apache-2.0
// Tests that for any size and place of the scene, its stage fits the panel and the depth budget,
// and its two maps are inverse.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

constexpr double kPanelWidth = 600.0;
constexpr double kPanelHeight = 300.0;
constexpr double kDistance = 700.0;

optics::OpticalModel random_model(std::mt19937& random) {
  std::uniform_real_distribution<double> gap(0.5, 10.0);
  std::uniform_real_distribution<double> pitch(4.0, 40.0);
  optics::Rig rig;
  rig.panel.width_px = 6000;
  rig.panel.height_px = 3000;
  rig.panel.pixel_width = Millimetres(kPanelWidth / 6000);
  rig.panel.pixel_height = Millimetres(kPanelHeight / 3000);
  rig.sheet.pitch = Subpixels(pitch(random));
  rig.sheet.gap = Millimetres(gap(random));
  rig.viewing.distance = Millimetres(kDistance);
  return optics::OpticalModel(rig);
}

/// Returns a cloud of spheres, 1e-6 to 1e6 in size, as far away as doubles still resolve it.
SceneDescription random_scene(std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const double size = std::pow(10.0, 6.0 * unit(random));
  const double far = std::min(1e7, 1e7 * size);
  const Vec3 place = Vec3{unit(random), unit(random), unit(random)} * far;
  SceneDescription scene;
  scene.source = "cloud";
  scene.materials.resize(1);
  for (int i = 0; i < 10; ++i) {
    Sphere s;
    s.centre = place + Vec3{unit(random), unit(random), unit(random)} * size;
    s.radius = 0.1 * size;
    scene.spheres.push_back(s);
  }
  return scene;
}

TEST(StageProperty, AnySceneFitsThePanelAndTheDepthBudget) {
  std::mt19937 random(21);
  for (int round = 0; round < 500; ++round) {
    const optics::OpticalModel model = random_model(random);
    const SceneDescription scene = random_scene(random);
    const Stage stage = make_stage(scene, model);
    const double budget = std::min(model.depth_of_field_mm(), kDistance);
    double widest = 0.0;
    for (const Sphere& s : scene.spheres) {
      const Vec3 p = stage.panel_from_world.point(s.centre);
      const double r = s.radius * stage.mm_per_unit;
      widest = std::max({widest, (std::abs(p.x) + r) / (0.45 * kPanelWidth),
                         (std::abs(p.y) + r) / (0.45 * kPanelHeight)});
      ASSERT_LE(std::abs(p.z) + r * stage.depth_scale, budget * (1 + 1e-6));
      ASSERT_LE(p.z + r * stage.depth_scale, kDistance / 2 * (1 + 1e-6));
    }
    ASSERT_NEAR(widest, 1.0, 1e-6) << "it fills what it may";
  }
}

TEST(StageProperty, TheMapsAreInverse) {
  std::mt19937 random(22);
  std::uniform_real_distribution<double> mm(-300.0, 300.0);
  for (int round = 0; round < 500; ++round) {
    const Stage stage = make_stage(random_scene(random), random_model(random));
    const Vec3 p{mm(random), mm(random), mm(random) / 10};
    const Vec3 back = stage.panel_from_world.point(stage.world_from_panel.point(p));
    ASSERT_LT(length(back - p), 1e-4);
  }
}

// Moving a scene together with its camera does not change the displayed frame.
TEST(StageProperty, TheStageFollowsTheCamera) {
  std::mt19937 random(23);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int round = 0; round < 200; ++round) {
    const optics::OpticalModel model = random_model(random);
    SceneDescription scene = random_scene(random);
    const Box b = scene_bounds(scene);
    const double size = length(b.high - b.low);
    Camera camera;
    camera.at = (b.low + b.high) / 2.0;
    camera.from = camera.at + Vec3{unit(random), unit(random), 2.0} * size;
    scene.cameras = {camera};
    const Stage here = make_stage(scene, model);
    const Vec3 step = Vec3{unit(random), unit(random), unit(random)} * size;
    for (Sphere& s : scene.spheres) s.centre += step;
    scene.cameras[0].from += step;
    scene.cameras[0].at += step;
    const Stage there = make_stage(scene, model);
    ASSERT_NEAR(there.mm_per_unit / here.mm_per_unit, 1.0, 1e-6);
    ASSERT_NEAR(there.depth_scale / here.depth_scale, 1.0, 1e-6);
    const Vec3 p = scene.spheres[0].centre;
    ASSERT_LT(length(there.panel_from_world.point(p) - here.panel_from_world.point(p - step)),
              1e-3);
  }
}

}  // namespace
}  // namespace lenticule::render
