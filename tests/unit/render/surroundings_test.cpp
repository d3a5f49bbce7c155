// SPDX-License-Identifier: Apache-2.0
#include "render/scene/surroundings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

/// Returns a texture of four columns and two rows; red is the column, green the row.
std::shared_ptr<const Texture> panorama() {
  auto texture = std::make_shared<Texture>();
  texture->width = 4;
  texture->height = 2;
  texture->repeat_v = false;
  for (int row = 0; row < 2; ++row)
    for (int column = 0; column < 4; ++column)
      for (const int value : {column, row, 0, 1})
        texture->rgba.push_back(static_cast<float>(value));
  return texture;
}

TEST(Backdrop, IsFlatByDefault) {
  SceneDescription scene;
  scene.background = {0.1, 0.2, 0.3};
  const Stage stage = test::make_tiny_stage();
  EXPECT_EQ(backdrop_light(make_backdrop(scene, stage, {}), {0, 1, 0}, 2), 0.3);
  Surroundings surroundings;
  surroundings.background = Vec3{0.7, 0.8, 0.9};
  EXPECT_EQ(backdrop_light(make_backdrop(scene, stage, surroundings), {0, 1, 0}, 1), 0.8);
}

TEST(Backdrop, SkyIsBlueAboveAndDarkBelow) {
  Surroundings surroundings;
  surroundings.sky = true;
  const Backdrop sky = make_backdrop({}, test::make_tiny_stage(), surroundings);
  EXPECT_GT(backdrop_light(sky, {0, 1, 0}, 2), backdrop_light(sky, {0, 1, 0}, 0));
  EXPECT_GT(backdrop_light(sky, {1, 0, 0}, 0), backdrop_light(sky, {0, 1, 0}, 0));
  EXPECT_GT(backdrop_light(sky, {1, 0, 0}, 0), backdrop_light(sky, {0, -1, 0}, 0));
}

TEST(Backdrop, TheEnvironmentsMiddleIsAheadAndItsRightIsToTheRight) {
  Backdrop backdrop;
  backdrop.environment = panorama();
  const double diagonal = std::sqrt(0.5);
  // Texel centres lie at +-45 and +-135 degrees; red numbers them from the left.
  EXPECT_NEAR(backdrop_light(backdrop, {-diagonal, 0, -diagonal}, 0), 1.0, 1e-9);
  EXPECT_NEAR(backdrop_light(backdrop, {diagonal, 0, -diagonal}, 0), 2.0, 1e-9);
  EXPECT_NEAR(backdrop_light(backdrop, {diagonal, 0, diagonal}, 0), 3.0, 1e-9);
  EXPECT_NEAR(backdrop_light(backdrop, {-diagonal, 0, diagonal}, 0), 0.0, 1e-9);
  EXPECT_NEAR(backdrop_light(backdrop, {0, 1, 0}, 1), 0.0, 1e-9);
  EXPECT_NEAR(backdrop_light(backdrop, {0, -1, 0}, 1), 1.0, 1e-9);
}

TEST(WorldUp, IsTheAxisNearestToThePanelsUp) {
  Stage stage = test::make_tiny_stage();
  EXPECT_EQ(world_up(stage), (Vec3{0, 1, 0}));
  stage.world_from_panel.column_y = {0.1, 0.2, 0.9};
  EXPECT_EQ(world_up(stage), (Vec3{0, 0, 1}));
  stage.world_from_panel.column_y = {0.1, -0.9, 0.2};
  EXPECT_EQ(world_up(stage), (Vec3{0, -1, 0}));
}

TEST(GroundPlane, LiesUnderTheSceneAndFacesUp) {
  for (const Vec3 up : {Vec3{0, 1, 0}, Vec3{0, 0, 1}, Vec3{1, 0, 0}, Vec3{0, -1, 0}}) {
    const Box bounds{.low = {-1, -2, -3}, .high = {3, 2, 1}};
    const TriangleMesh ground = ground_plane(bounds, up, 0);
    double lowest = dot(bounds.low, up);
    lowest = std::min(lowest, dot(bounds.high, up));
    for (const auto& triangle : ground.triangles) {
      const Vec3 a = ground.positions[triangle[0]];
      const Vec3 normal =
          normalized(cross(ground.positions[triangle[1]] - a, ground.positions[triangle[2]] - a));
      EXPECT_EQ(normal, up);
      EXPECT_LT(dot(a, up), lowest);
      EXPECT_GT(dot(a, up), lowest - 0.01);
    }
  }
}

}  // namespace
}  // namespace lenticule::render
