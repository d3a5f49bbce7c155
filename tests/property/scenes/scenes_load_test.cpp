// SPDX-License-Identifier: Apache-2.0
// Whatever a built-in scene writes, the NFF reader reads, without a complaint.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "render/loaders/nff.h"
#include "scenes/scene_list.h"

namespace lenticule::scenes {
namespace {

class EveryScene : public ::testing::TestWithParam<int> {};

TEST_P(EveryScene, IsReadBackWithoutANote) {
  const BuiltInScene& scene = scene_list()[static_cast<size_t>(GetParam())];
  // At size 1 the teapot's lip is cut so coarsely that four of its triangles have no area.
  for (const int size : {2, 3, 5}) {
    for (const int frame : {0, scene.frames / 3, scene.frames - 1}) {
      const auto read = render::parse_nff(write_scene(scene, size, frame), scene.name);
      EXPECT_THAT(read.notes, ::testing::IsEmpty()) << scene.name << " size " << size;
      EXPECT_EQ(read.cameras.size(), 1U);
      EXPECT_FALSE(read.lights.empty());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, EveryScene,
                         ::testing::Range(0, static_cast<int>(scene_list().size())),
                         [](const auto& index) {
                           std::string name = scene_list()[static_cast<size_t>(index.param)].name;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

// Spheres of one generation may touch but must not run into each other.
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

}  // namespace
}  // namespace lenticule::scenes
