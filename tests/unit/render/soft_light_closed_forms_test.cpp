// SPDX-License-Identifier: Apache-2.0
// Tests soft shadows, occlusion and environment light where the exact light is known.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "frames/srgb.h"
#include "tests/unit/render/soft_light_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;

/// No point of the light is visible from the wall behind a wide screen.
TEST(SoftShadows, AreCompleteBehindAScreen) {
  SceneDescription scene = wall_and_ball();
  scene.spheres.clear();
  scene.lights.front().position = {0.0, 0.0, -9.0};  // wholly behind the wall
  const optics::Rig rig = make_rig({});
  SceneDescription unlit = scene;
  unlit.lights.clear();
  EXPECT_EQ(picture(scene, rig, make_tiny_stage(), with(only_shadows(9))).frame,
            picture(unlit, rig, make_tiny_stage(), with({})).frame);
}

/// Nothing occludes: all samples agree.
TEST(Occlusion, IsZeroForAnOpenSurface) {
  SceneDescription scene = wall_and_ball();
  scene.spheres.clear();
  const optics::Rig rig = make_rig({});
  EXPECT_EQ(picture(scene, rig, make_tiny_stage(), with(only_occlusion(7))).frame,
            picture(scene, rig, make_tiny_stage(), with({})).frame);
}

/// Inside a closed box every ray to the hemisphere ends at a wall.
TEST(Occlusion, IsCompleteInAClosedRoom) {
  SceneDescription scene = wall_and_ball();
  scene.lights.clear();
  scene.meshes = {test::box_mesh({-9, -8, -4}, {9, 8, 9}, 0)};
  Stage inside = make_tiny_stage();
  inside.near_mm = 20.0;
  const double inf = std::numeric_limits<double>::infinity();
  const SoftLight far{.occlusion_samples = 5, .occlusion_distance_mm = inf};
  const auto expect_all = [&](const SoftLight& soft, int expected) {
    const frames::WovenFrame frame = picture(scene, make_rig({}), inside, with(soft)).frame;
    for (const uint8_t code : frame.bytes()) ASSERT_EQ(code, expected);
  };
  expect_all(far, 0);
  expect_all(only_environment(5), 0);
  expect_all({}, 102);
}

/// A white surface in an environment of uniform brightness has the environment's brightness and a
/// grey one half of it, with smooth normals or without.
TEST(EnvironmentLight, OfUniformBrightnessIsReflectedByEverySurface) {
  SceneDescription scene;
  scene.colour_managed = false;
  scene.background = {0.8, 0.8, 0.8};
  scene.ambient = Vec3{0.1, 0.1, 0.1};
  scene.materials = {Material{}, Material{.colour = {0.5, 0.5, 0.5}}};
  scene.spheres = {{.centre = {-2.5, 0, 0}, .radius = 1.2, .material = 1}};
  scene.meshes = {test::ball_mesh({2.5, 0, 0}, 1.2, 5, 1), test::ball_mesh({0, 0, 0}, 1, 4, 0)};
  // One object at a time, since several would reflect each other.
  const optics::Rig rig = make_rig({});
  int half = 0;
  for (int only = 0; only < 3; ++only) {
    SceneDescription alone = scene;
    if (only != 0) alone.spheres.clear();
    alone.meshes.clear();
    if (only != 0) alone.meshes = {scene.meshes[static_cast<size_t>(only - 1)]};
    const Picture made = picture(alone, rig, make_tiny_stage(), with(only_environment(6)));
    EXPECT_GT(made.statistics.ambient_rays, 100U);
    for (const uint8_t code : made.frame.bytes()) {
      ASSERT_TRUE(code == 204 || (code == 102 && only != 2)) << int{code} << " of " << only;
      half += code == 102 ? 1 : 0;
    }
  }
  EXPECT_GT(half, 20);
}

/// An unoccluded wall under a sky: the sum over all directions, by quadrature.
TEST(EnvironmentLight, OfASkyEqualsItsIntegral) {
  SceneDescription scene = wall_and_ball();
  scene.colour_managed = true;
  scene.spheres.clear();
  scene.lights.clear();
  const optics::Rig rig = make_rig({});
  Surroundings surroundings;
  surroundings.sky = true;
  const frames::WovenFrame frame =
      picture(scene, rig, make_tiny_stage(), with(only_environment(1024)), surroundings).frame;
  const Scene committed(scene, make_tiny_stage(), surroundings, 1);
  constexpr int kSteps = 400;
  for (int c = 0; c < 3; ++c) {
    double sum = 0.0;
    for (int a = 0; a < kSteps; ++a)
      for (int b = 0; b < kSteps; ++b) {
        const double radius = std::sqrt((a + 0.5) / kSteps);
        const double angle = 2.0 * std::numbers::pi * (b + 0.5) / kSteps;
        sum += backdrop_light(
            committed.backdrop,
            {radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1.0 - radius * radius)},
            c);
      }
    const double expected = 255.0 * frames::srgb_from_linear(sum / (kSteps * kSteps));
    for (int i = 0; i < frame.width(); ++i) ASSERT_NEAR(frame.row(3)[3 * i + c], expected, 1.2);
  }
}

}  // namespace
}  // namespace lenticule::render
