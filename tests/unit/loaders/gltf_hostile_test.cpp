// SPDX-License-Identifier: Apache-2.0
// Tests that damaged and hostile glTF is refused, with the file and the path of the JSON value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render/loaders/formats.h"
#include "tests/support/error_matchers.h"
#include "tests/support/gltf_model.h"

namespace lenticule::render {
namespace {

using ::testing::HasSubstr;
using namespace lenticule::test;

/// A case of tests/data/gltf-attacks.json: what is changed of the quad, and what the error says
/// after the file's name.
class GltfAttack : public ::testing::TestWithParam<nlohmann::ordered_json> {};

TEST_P(GltfAttack, IsRefusedWithThePathOfTheValue) {
  const GltfModel model(GetParam()["model"]);
  const Error error = error_of([&] { (void)parse_gltf(model.gltf(), "model.gltf", std::nullopt); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), HasSubstr(GetParam()["error"].get<std::string>()));
}

INSTANTIATE_TEST_SUITE_P(
    Hostile, GltfAttack,
    ::testing::ValuesIn(gltf_cases(LENTICULE_SOURCE_DIR "/tests/data/gltf-attacks.json")),
    [](const auto& info) { return info.param["name"].template get<std::string>(); });

TEST(GltfAttack, AMillionBracketsAreRefused) {
  const std::string text = "{\"asset\":" + std::string(1'000'000, '[');
  const Error error = error_of([&] {
    (void)parse_gltf({text.begin(), text.end()}, "model.gltf", std::nullopt);
  });
  EXPECT_THAT(error.what(), HasSubstr("model.gltf: JSON nested deeper than 64 levels"));
}

TEST(GltfAttack, Ktx2HasARemedy) {
  GltfModel model;
  model.require("KHR_texture_basisu");
  EXPECT_THAT(error_of([&] { (void)parse_gltf(model.glb(), "model.glb", std::nullopt); }).hint(),
              HasSubstr("gltf-transform"));
}

TEST(GltfAttack, EveryTruncationOfABinaryContainerIsRefused) {
  GltfModel model;
  const ByteVector whole = model.glb();
  for (size_t size = 0; size < whole.size(); ++size) {
    const ByteVector part(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_THROW((void)parse_gltf(part, "model.glb", std::nullopt), Error) << size;
  }
}

TEST(GltfAttack, EveryChangedByteOfCompressedDataIsRefusedOrGivesAScene) {
  GltfModel model;
  const ByteVector draco = draco_quad();
  const int view = model.add_view(draco);
  model.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", view}, {"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}}};
  const ByteVector whole = model.glb();
  size_t scenes = 0;
  for (size_t i = whole.size() - draco.size() - 3; i < whole.size(); ++i) {
    ByteVector changed = whole;
    changed[i] ^= 0x55;
    try {
      const SceneDescription scene = parse_gltf(changed, "model.glb", std::nullopt);
      for (const TriangleMesh& mesh : scene.meshes)
        for (const auto& triangle : mesh.triangles)
          for (const uint32_t corner : triangle) ASSERT_LT(corner, mesh.positions.size());
      ++scenes;
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::Input);
    }
  }
  EXPECT_LT(scenes, whole.size());
}

}  // namespace
}  // namespace lenticule::render
