// SPDX-License-Identifier: Apache-2.0
// Tests committing scenes: refused input, and the resulting positions.
#include "render/scene/scene.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "base/error.h"
#include "render/scene/surroundings.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

SceneDescription good_scene() {
  SceneDescription scene;
  scene.source = "good.test";
  scene.materials = {Material{}};
  scene.meshes = {test::box_mesh({-1, -1, -1}, {1, 1, 1}, 0)};
  scene.spheres = {{.centre = {3, 0, 0}, .radius = 1}};
  Cone cone;
  cone.base = {-3, 0, 0};
  cone.apex = {-3, 1, 0};
  scene.cones = {cone};
  scene.lights.emplace_back();
  return scene;
}

std::string refusal(const SceneDescription& scene, const Surroundings& surroundings = {}) {
  try {
    const Scene committed(scene, test::make_tiny_stage(), surroundings, 1);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return error.what();
  }
  return "";
}

TEST(SceneCommit, AcceptsEveryKindOfGeometry) { EXPECT_EQ(refusal(good_scene()), ""); }

TEST(SceneCommit, RefusesEveryNumberThatIsNotFiniteNamingTheFile) {
  const std::vector<std::function<void(SceneDescription&, double)>> spoils = {
      [](auto& s, double v) { s.meshes[0].positions[3].y = v; },
      [](auto& s, double v) { s.spheres[0].centre.x = v; },
      [](auto& s, double v) { s.spheres[0].radius = v; },
      [](auto& s, double v) { s.cones[0].base.z = v; },
      [](auto& s, double v) { s.cones[0].apex.z = v; },
      [](auto& s, double v) { s.cones[0].apex_radius = v; },
      [](auto& s, double v) { s.lights[0].position.x = v; },
      [](auto& s, double v) { s.lights[0].colour.x = v; },
      [](auto& s, double v) { s.materials[0].diffuse = v; },
      [](auto& s, double v) { s.materials[0].colour.z = v; },
      [](auto& s, double v) { s.materials[0].refraction_index = v; },
      [](auto& s, double v) {
        s.ambient = Vec3{v, 0, 0};
      },
      [](auto& s, double v) {
        s.meshes[0].normals.assign(8, Vec3{0, v, 1});
      },
  };
  for (size_t i = 0; i < spoils.size(); ++i)
    for (const double value : {kNan, kInfinity, -kInfinity}) {
      SceneDescription scene = good_scene();
      spoils[i](scene, value);
      EXPECT_EQ(refusal(scene).rfind("good.test: ", 0), 0U) << i << " " << refusal(scene);
    }
}

TEST(SceneCommit, RefusesIndicesOutOfRange) {
  SceneDescription scene = good_scene();
  scene.meshes[0].triangles[2][1] = 8;
  EXPECT_EQ(refusal(scene), "good.test: mesh 'box' refers to vertex 8, which does not exist");
  scene = good_scene();
  scene.meshes[0].material = 1;
  EXPECT_EQ(refusal(scene), "good.test: mesh 'box' refers to material 1, which does not exist");
  scene = good_scene();
  scene.spheres[0].material = -1;
  EXPECT_NE(refusal(scene), "");
  scene = good_scene();
  scene.materials[0].texture = 0;
  EXPECT_NE(refusal(scene), "");
  scene = good_scene();
  scene.meshes[0].normals.resize(3, {0, 1, 0});
  EXPECT_NE(refusal(scene), "");
  scene = good_scene();
  scene.meshes[0].uvs.resize(9);
  EXPECT_NE(refusal(scene), "");
}

TEST(SceneCommit, RefusesImpossibleSizes) {
  SceneDescription scene = good_scene();
  scene.spheres[0].radius = -1.0;
  EXPECT_NE(refusal(scene), "");
  scene = good_scene();
  scene.cones[0].apex = scene.cones[0].base;
  EXPECT_EQ(refusal(scene), "good.test: cone has no height");
  scene = good_scene();
  scene.meshes[0].positions[0].x = 1e200;
  EXPECT_NE(refusal(scene), "");
}

TEST(SceneCommit, RefusesAStageWithoutSize) {
  Stage stage = test::make_tiny_stage();
  stage.world_from_panel.column_z = {0, 0, 0};
  EXPECT_THROW(Scene(good_scene(), stage, {}, 1), Error);
}

TEST(SceneCommit, RefusesAMissingEnvironment) {
  Surroundings surroundings;
  surroundings.environment_file = "/nowhere/sky.png";
  EXPECT_NE(refusal(good_scene(), surroundings).find("/nowhere/sky.png"), std::string::npos);
}

TEST(SceneCommit, AcceptsAnEmptyScene) {
  SceneDescription scene;
  scene.source = "empty";
  EXPECT_EQ(refusal(scene), "");
}

TEST(SceneCommit, CentresAndScalesOnTheStage) {
  SceneDescription scene;
  scene.spheres = {{.centre = {1e7 + 2.0, -1e7, 5e6}, .radius = 0.5}};
  const Stage stage = test::make_tiny_stage({.centre = {1e7, -1e7, 5e6}, .mm_per_unit = 20.0});
  const Scene committed(scene, stage, {}, 1);
  const SphereShape& sphere = committed.spheres.at(0);
  const Vec3 on_panel = committed.scene_from_panel.inverse().point(sphere.centre);
  EXPECT_NEAR(on_panel.x, 40.0, 1e-6);
  EXPECT_NEAR(on_panel.y, 0.0, 1e-6);
  EXPECT_EQ(committed.frame.units_per_world, 16.0);
  EXPECT_NEAR(sphere.radius / committed.units_per_mm, 10.0, 1e-9);
}

TEST(SceneCommit, KnowsTheNearestPointOfEveryPrimitive) {
  const Stage stage = test::make_tiny_stage({.mm_per_unit = 10.0, .depth_scale = 0.5});
  SceneDescription scene;
  scene.spheres = {{.centre = {0, 0, 3}, .radius = 1}};
  EXPECT_NEAR(Scene(scene, stage, {}, 1).near_mm, 20.0, 1e-9);
  Cone cone;  // lies along x: the rim is a radius nearer to the viewer
  cone.base = {-1, 0, 5};
  cone.apex = {1, 0, 5};
  cone.base_radius = cone.apex_radius = 1.0;
  scene.cones = {cone};
  EXPECT_NEAR(Scene(scene, stage, {}, 1).near_mm, 30.0, 1e-9);
  scene.meshes = {test::box_mesh({0, 0, 0}, {1, 1, 8}, 0)};
  EXPECT_NEAR(Scene(scene, stage, {}, 1).near_mm, 40.0, 1e-9);
}

TEST(SceneCommit, AppliesTheStagesNearBound) {
  Stage stage = test::make_tiny_stage({.mm_per_unit = 10.0});
  SceneDescription scene;
  scene.spheres = {{.centre = {0, 0, 3}, .radius = 1}};
  stage.near_mm = 15.0;
  EXPECT_NEAR(Scene(scene, stage, {}, 1).near_mm, 15.0, 1e-9);
}

TEST(SceneCommit, AddsLightsToASceneWithoutLights) {
  SceneDescription scene = good_scene();
  scene.lights.clear();
  EXPECT_EQ(Scene(scene, test::make_tiny_stage(), {}, 1).lights.size(), 1U);
  scene.ambient = Vec3{0.5, 0.5, 0.5};
  EXPECT_EQ(Scene(scene, test::make_tiny_stage(), {}, 1).lights.size(), 0U);
}

TEST(SceneCommit, TheDefaultSunShinesAlikeAtEveryDepthScale) {
  SceneDescription scene = good_scene();
  scene.lights.clear();
  const auto sun = [&](double depth_scale) {
    const Stage stage = test::make_tiny_stage({.depth_scale = depth_scale, .turn_degrees = 30});
    return Scene(scene, stage, {}, 1).lights.at(0).direction;
  };
  EXPECT_LT(length(sun(0.02) - sun(1.0)), 1e-12);
  const Stage turned = test::make_tiny_stage({.turn_degrees = 30});
  const Vec3 as_seen = normalized(turned.panel_from_world.vector(sun(1.0)));
  EXPECT_LT(length(as_seen - normalized(kDefaultSunDirection)), 1e-12);
}

}  // namespace
}  // namespace lenticule::render
