// SPDX-License-Identifier: Apache-2.0
// Tests the input for Tachyon and the parsing of its output.
#include "lab/judges/peers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "base/error.h"
#include "render/loaders/nff.h"
#include "scenes/scene_list.h"

namespace lenticule::bench {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Returns a scene with one of every primitive that both formats support.
render::SceneDescription small_scene() {
  return render::parse_nff(
      "v from 0 -4 1 at 0 0 1 up 0 0 1 angle 60 hither 0.1 resolution 8 8\n"
      "b 0.1 0.2 0.3\n"
      "l 1 2 3\n"
      "f 1 0.5 0.25 0.8 0.2 20 0 1\n"
      "s 0 0 1 0.5\n"
      "c 0 0 0 0.5 0 0 1 0.25\n"
      "c 1 0 0 0.5 1 0 1 0.5\n"
      "p 3 0 0 0 1 0 0 0 1 0\n"
      "pp 3 0 0 0 0 0 1 1 0 0 0 0 1 0 1 0 0 0 1\n",
      "small");
}

double triangle_area(const render::SceneDescription& scene) {
  double area = 0.0;
  for (const auto& mesh : scene.meshes)
    for (const auto& [a, b, c] : mesh.triangles)
      area += length(cross(mesh.positions[b] - mesh.positions[a],
                           mesh.positions[c] - mesh.positions[a])) /
              2.0;
  return area;
}

// Writes, reads, writes as plain text and reads again: nothing is lost in either step.
TEST(PlainNff, KeepsEveryBuiltInScene) {
  for (const scenes::BuiltInScene& built_in : scenes::scene_list()) {
    const auto once = render::parse_nff(scenes::write_scene(built_in, 2, 5), built_in.name);
    const auto again = render::parse_nff(lab::write_plain_nff(once), built_in.name);
    EXPECT_THAT(again.notes, ::testing::IsEmpty()) << built_in.name;
    EXPECT_EQ(again.materials.size(), once.materials.size()) << built_in.name;
    EXPECT_EQ(again.lights.size(), once.lights.size()) << built_in.name;
    EXPECT_EQ(again.cameras.at(0).from, once.cameras.at(0).from) << built_in.name;
    ASSERT_EQ(again.spheres.size(), once.spheres.size()) << built_in.name;
    ASSERT_EQ(again.cones.size(), once.cones.size()) << built_in.name;
    for (size_t i = 0; i < once.spheres.size(); ++i) {
      ASSERT_EQ(again.spheres[i].centre, once.spheres[i].centre) << built_in.name;
      ASSERT_EQ(again.spheres[i].radius, once.spheres[i].radius) << built_in.name;
    }
    for (size_t i = 0; i < once.cones.size(); ++i) {
      ASSERT_EQ(again.cones[i].apex, once.cones[i].apex) << built_in.name;
      ASSERT_EQ(again.cones[i].base_radius, once.cones[i].base_radius) << built_in.name;
    }
    EXPECT_NEAR(triangle_area(again), triangle_area(once), 1e-9 * triangle_area(once));
  }
}

TEST(PlainNff, HasEveryCopyOfAShape) {
  render::SceneDescription scene = small_scene();
  scene.shapes = {std::make_shared<const render::TriangleMesh>(scene.meshes.at(0))};
  scene.meshes.clear();
  const double area_of_one = triangle_area({.meshes = {*scene.shapes[0]}});
  for (const double x : {10.0, 20.0})
    scene.meshes.push_back({.material = 0, .shape = 0, .place = {.origin = {x, 0, 0}}});
  const auto again = render::parse_nff(lab::write_plain_nff(scene), "again");
  EXPECT_NEAR(triangle_area(again), 2.0 * area_of_one, 1e-9);
  for (const auto& mesh : again.meshes)
    for (const Vec3& position : mesh.positions) EXPECT_GE(position.x, 10.0);
}

TEST(PlainNff, HasTheMeanColourOfTextures) {
  render::SceneDescription scene = small_scene();
  scene.textures.push_back(std::make_shared<const render::Texture>(
      render::Texture{.width = 2, .height = 1, .rgba = {1, 0.5, 0, 1, 0, 0.5, 0.5, 1}}));
  scene.materials[0].colour = {1, 1, 0.5};
  scene.materials[0].texture = 0;
  EXPECT_THAT(lab::write_plain_nff(scene), HasSubstr("\nf 0.5 0.5 0.125 0.8 "));
}

TEST(Tachyon, CountsCameraRaysAsOneBounce) {
  const lab::PeerJob job{.width = 640, .height = 360, .threads = 2, .max_depth = 1, .picture = ""};
  EXPECT_THAT(lab::tachyon_arguments("scene.nff", job),
              ElementsAre("scene.nff", "-res", "640", "360", "-numthreads", "2", "-raydepth", "2",
                          "-fullshade", "-nosave"));
}

}  // namespace
}  // namespace lenticule::bench
