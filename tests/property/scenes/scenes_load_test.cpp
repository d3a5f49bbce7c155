// SPDX-License-Identifier: Apache-2.0
// Tests that the NFF reader reads every built-in scene without a warning.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "render/loaders/animation.h"
#include "render/loaders/nff.h"
#include "scenes/scene_list.h"

namespace lenticule::scenes {
namespace {

class EveryScene : public ::testing::TestWithParam<int> {};

TEST_P(EveryScene, IsReadBackWithoutAWarning) {
  const BuiltInScene& scene = scene_list()[static_cast<size_t>(GetParam())];
  // The teapot's lip of size 1 is so coarse that four of its triangles have no area.
  for (const int size : {2, 3, 5}) {
    // The detail of a size is the same in every frame.
    for (const int frame : size == 2 ? std::vector{0, scene.frames / 3, scene.frames - 1}
                                     : std::vector{scene.frames / 3}) {
      const auto read = render::parse_nff(write_scene(scene, size, frame), scene.name);
      EXPECT_THAT(read.notes, ::testing::IsEmpty()) << scene.name << " size " << size;
      EXPECT_EQ(read.cameras.size(), 1U);
      EXPECT_FALSE(read.lights.empty());
    }
  }
}

// A camera path has no jumps and ends next to its start.
TEST_P(EveryScene, ItsCameraPathIsReadBackAndSmooth) {
  const BuiltInScene& scene = scene_list()[static_cast<size_t>(GetParam())];
  const auto path = render::parse_camera_path(write_camera_path(scene, 2), scene.name);
  ASSERT_EQ(path.size(), static_cast<size_t>(scene.frames));
  for (size_t k = 0; k < path.size(); ++k) {
    const render::Camera& camera = path[k];
    const render::Camera& next = path[(k + 1) % path.size()];
    const double distance = length(camera.from - camera.at);
    EXPECT_LT(length(next.from - camera.from), 0.04 * distance) << scene.name << " frame " << k;
    if (k % 100 != 0) continue;
    const auto read = render::parse_nff(write_scene(scene, 2, static_cast<int>(k)), scene.name);
    EXPECT_EQ(read.cameras.at(0).from, camera.from);
    EXPECT_EQ(read.cameras.at(0).vertical_fov_degrees, camera.vertical_fov_degrees);
  }
}

// One NFF file and the camera path describe the whole sequence.
TEST_P(EveryScene, OnlyTheCameraMovesIfDeclared) {
  const BuiltInScene& scene = scene_list()[static_cast<size_t>(GetParam())];
  const auto without_view = [&](int frame) {
    const std::string text = write_scene(scene, 2, frame);
    return text.substr(text.find("\nb "));
  };
  EXPECT_EQ(without_view(0) == without_view(scene.frames / 3),
            scene.only_camera_moves || scene.frames == 1);
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene,
                         ::testing::Range(0, static_cast<int>(scene_list().size())),
                         [](const auto& index) {
                           std::string name = scene_list()[static_cast<size_t>(index.param)].name;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

// Spheres of one level may touch but must not intersect.
TEST(BallsScene, NoTwoSpheresIntersect) {
  const auto read = render::parse_nff(write_scene(find_scene("balls"), 3, 0), "balls");
  for (size_t i = 0; i < read.spheres.size(); ++i) {
    for (size_t j = i + 1; j < read.spheres.size(); ++j) {
      const auto& a = read.spheres[i];
      const auto& b = read.spheres[j];
      ASSERT_GT(length(a.centre - b.centre), (a.radius + b.radius) * (1.0 - 1e-6)) << i << ' ' << j;
    }
  }
}

TEST(TreeScene, IsFiniteStandsOnItsGroundAndFitsItsCamera) {
  const auto read = render::parse_nff(write_scene(find_scene("tree"), 11, 0), "tree");
  ASSERT_EQ(read.cones.size(), read.spheres.size());
  Vec3 low{};
  Vec3 high{};
  for (size_t i = 0; i < read.cones.size(); ++i) {
    const render::Cone& cone = read.cones[i];
    const render::Sphere& joint = read.spheres[i];
    ASSERT_TRUE(is_finite(cone.base) && is_finite(cone.apex)) << i;
    ASSERT_LT(length(cone.apex - joint.centre), 1e-6) << i;
    ASSERT_NEAR(cone.apex_radius, joint.radius, 1e-9) << i;
    low = {std::min(low.x, cone.apex.x), std::min(low.y, cone.apex.y),
           std::min(low.z, cone.apex.z)};
    high = {std::max(high.x, cone.apex.x), std::max(high.y, cone.apex.y),
            std::max(high.z, cone.apex.z)};
  }
  EXPECT_GE(low.z, 0.0);
  EXPECT_GT(high.z, 2.0);
  EXPECT_LT(high.z, 3.2);
  for (const double reach : {-low.x, -low.y, high.x, high.y}) {
    EXPECT_GT(reach, 0.5);
    EXPECT_LT(reach, 2.0);
  }
}

}  // namespace
}  // namespace lenticule::scenes
