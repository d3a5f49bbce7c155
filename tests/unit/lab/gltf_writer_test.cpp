// SPDX-License-Identifier: Apache-2.0
// Tests scenes written as glTF by reading them back with the production loader.
#include "lab/judges/gltf_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/lenticule-tools/offline/scene_sequence.h"
#include "base/error.h"
#include "render/loaders/load_scene.h"
#include "render/scene/stage.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/texels.h"

namespace lenticule::lab {
namespace {

render::SceneDescription built_in(const char* name, int size) {
  return tools::describe_built_in(scenes::find_scene(name), size);
}

render::SceneDescription read_back(const GltfText& gltf) {
  const test::ScratchFolder folder;
  const std::string file = (folder / "scene.gltf").string();
  std::ofstream(file) << gltf.json;
  return render::at_time(render::load_scene(file), 0.0);
}

size_t triangle_count(const render::SceneDescription& scene) {
  size_t count = 0;
  for (const auto& mesh : scene.meshes) count += mesh.triangles.size();
  return count;
}

TEST(GltfWriter, GearsAreReadBackWithEveryTriangleLightAndTexture) {
  const render::SceneDescription gears = built_in("gears", 1);
  const render::SceneDescription again = read_back(write_gltf(gears));
  EXPECT_EQ(triangle_count(again), triangle_count(gears));
  EXPECT_EQ(again.lights.size(), gears.lights.size());
  ASSERT_EQ(again.cameras.size(), 1U);
  EXPECT_NEAR(again.cameras[0].vertical_fov_degrees, gears.cameras[0].vertical_fov_degrees, 1e-3);
  ASSERT_EQ(again.textures.size(), 1U);
  EXPECT_EQ(again.textures[0]->width, gears.textures[0]->width);
}

// glTF's up is y, the scene's is z.
TEST(GltfWriter, ConvertsTheUpAxis) {
  const render::SceneDescription gears = built_in("gears", 1);
  const render::SceneDescription again = read_back(write_gltf(gears));
  const Box before = render::scene_bounds(gears);
  const Box after = render::scene_bounds(again);
  EXPECT_NEAR(after.high.y, before.high.z, 1e-5);
  EXPECT_NEAR(after.low.y, before.low.z, 1e-5);
  EXPECT_NEAR(after.high.x, before.high.x, 1e-5);
  EXPECT_NEAR(again.cameras[0].from.y, gears.cameras[0].from.z, 1e-5);
  EXPECT_NEAR(again.cameras[0].up.y, 1.0, 0.7);
}

TEST(GltfWriter, KeepsNormalsAndTexels) {
  render::SceneDescription scene = built_in("teapot", 2);
  scene.textures.push_back(std::make_shared<const render::Texture>(
      render::Texture{.width = 2, .height = 1, .rgba = {1, 0.5F, 0, 1, 0, 0.2F, 0.8F, 1}}));
  scene.meshes[0].uvs.assign(scene.meshes[0].positions.size(), {0.25F, 0.5F});
  scene.materials[static_cast<size_t>(scene.meshes[0].material)].texture = 0;
  const render::SceneDescription again = read_back(write_gltf(scene));
  ASSERT_EQ(again.textures.size(), 1U);
  const std::vector<float> texels = test::texels_of(*again.textures[0]);
  EXPECT_NEAR(texels[0], 1.0F, 1e-6F);
  EXPECT_NEAR(texels[1], 0.2159F, 1e-3F) << "linear light of code 128";
  const auto smooth = std::count_if(again.meshes.begin(), again.meshes.end(),
                                    [](const auto& mesh) { return !mesh.normals.empty(); });
  EXPECT_GE(smooth, 1);
}

TEST(GltfWriter, RefusesScenesWithSpheres) {
  for (const char* name : {"balls", "tree", "room"}) {
    test::expect_error(test::error_of([&] { (void)write_gltf(built_in(name, 1)); }),
                       ErrorKind::Usage, "spheres");
  }
  const GltfText gears = write_gltf(built_in("gears", 1));
  EXPECT_THAT(gears.notes, ::testing::Contains(::testing::HasSubstr("fall off")));
  EXPECT_TRUE(nlohmann::json::accept(gears.json));
}

}  // namespace
}  // namespace lenticule::lab
