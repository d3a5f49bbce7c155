// SPDX-License-Identifier: Apache-2.0
// Tests that a FlatView is a pinhole camera.
#include "apps/lenticule-tools/offline/thumbnail.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace lenticule::tools {
namespace {

render::SceneDescription ball() {
  render::SceneDescription scene;
  scene.source = "ball";
  scene.materials = {render::Material{}};
  scene.spheres = {{.centre = {0, 0, 0}, .radius = 1}};
  return scene;
}

render::SceneDescription filmed(double degrees) {
  render::SceneDescription scene = ball();
  render::Camera camera;
  camera.from = {0, 0, 10};
  camera.vertical_fov_degrees = degrees;
  scene.cameras = {camera};
  return scene;
}

TEST(FlatView, AllRaysGoFromTheirSubpixelsThroughTheCamera) {
  for (const double degrees : {1.0, 40.0, 120.0}) {
    const FlatView view = make_flat_view(filmed(degrees));
    const optics::Panel& panel = view.model.rig().panel;
    const double distance = view.model.rig().viewing.distance.value;
    for (const int i : {0, 1, 333, panel.width_px / 2, panel.width_px - 1})
      for (const int j : {0, 400, panel.height_px - 1})
        for (int c = 0; c < 3; ++c) {
          const optics::SubpixelRay ray = view.model.ray(i, j, c);
          EXPECT_NEAR(ray.lens_x_mm + ray.tan_x * distance, 0.0, 1e-6 * distance) << degrees;
          EXPECT_NEAR(ray.lens_y_mm + ray.tan_y * distance, 0.0, 1e-6 * distance) << degrees;
          // The ray leaves in front of the subpixel, a little toward the camera.
          const double in_front = panel.x_mm(panel.subpixel_centre_px(i, j, c).x);
          EXPECT_NEAR(ray.lens_x_mm, in_front * distance / (distance + 1.0), 1e-6) << degrees;
        }
  }
}

TEST(FlatView, HasTheCamerasPlaceAndFieldOfView) {
  const FlatView view = make_flat_view(filmed(40.0));
  EXPECT_EQ(view.stage.depth_scale, 1.0);
  const Vec3 camera = view.stage.panel_from_world.point({0, 0, 10});
  EXPECT_NEAR(camera.z, view.model.rig().viewing.distance.value, 1e-6);
  const Vec3 top =
      view.stage.panel_from_world.point({0, 10.0 * std::tan(20.0 * std::numbers::pi / 180.0), 0});
  EXPECT_NEAR(top.y, view.model.rig().panel.y_mm(0.0), 1e-6);
}

TEST(FlatView, WithoutACameraTheEyeStaysBeforeTheScene) {
  render::SceneDescription scene = ball();
  scene.spheres.push_back({.centre = {0, 0, 500}, .radius = 1});
  scene.spheres.push_back({.centre = {0, 0, -500}, .radius = 1});
  const FlatView view = make_flat_view(scene);
  EXPECT_LE(view.stage.near_mm, view.model.rig().viewing.distance.value / 2.0 * (1 + 1e-9));
  EXPECT_EQ(make_flat_view(ball()).stage.depth_scale, 1.0);
}

}  // namespace
}  // namespace lenticule::tools
