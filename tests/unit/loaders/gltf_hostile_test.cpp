// SPDX-License-Identifier: Apache-2.0
// Tests that damaged and hostile glTF is refused, with the file and the path of the JSON value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "render/loaders/gltf_loader.h"
#include "tests/support/gltf_model.h"
#include "tests/unit/loaders/error_of.h"

namespace lenticule::render {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using namespace lenticule::test;

/// A change that makes the quad invalid, and what the error says after the file's name.
struct Attack {
  const char* name;
  std::function<void(GltfModel&)> change;
  const char* message;
};

json& accessor(GltfModel& model, size_t index) {
  return model.json["accessors"][index];
}

json& view(GltfModel& model, size_t index) {
  return model.json["bufferViews"][index];
}

void add_meshopt(GltfModel& model, const json& changes) {
  json compressed = {{"buffer", 0}, {"byteOffset", 0},  {"byteLength", 48},
                     {"count", 4},  {"byteStride", 12}, {"mode", "ATTRIBUTES"}};
  compressed.update(changes);
  view(model, 0)["extensions"]["EXT_meshopt_compression"] = compressed;
}

const std::vector<Attack> kAttacks{
    {"AViewThatIsNotThere", [](GltfModel& m) { accessor(m, 3)["bufferView"] = 12; },
     "accessors[3].bufferView: 12 of 4 buffer views"},
    {"ANegativeView", [](GltfModel& m) { accessor(m, 0)["bufferView"] = -1; },
     "accessors[0].bufferView: -1 is no count, offset or index"},
    {"AnIndexBeyond32Bits", [](GltfModel& m) { accessor(m, 0)["bufferView"] = 4294967296; },
     "accessors[0].bufferView: 4294967296 of 4 buffer views"},
    {"AFractionAsIndex", [](GltfModel& m) { m.node()["mesh"] = 0.5; },
     "nodes[0].mesh: 0.5 is no count, offset or index"},
    {"ATextAsIndex", [](GltfModel& m) { m.node()["mesh"] = "0"; }, "nodes[0].mesh: not a number"},
    {"AHugeCount", [](GltfModel& m) { accessor(m, 0)["count"] = 2147483648; },
     "accessors[0].count: 2147483648, expected 1 to"},
    {"AHugeCountWithoutBytes",
     [](GltfModel& m) {
       accessor(m, 0).erase("bufferView");
       accessor(m, 0)["count"] = 200000000;
     },
     "accessors[0].count: 200000000 elements without a buffer view, the file and its buffers have"},
    {"ACountOfZero", [](GltfModel& m) { accessor(m, 0)["count"] = 0; },
     "accessors[0].count: 0, expected 1 to"},
    {"ACountBeyondTheView", [](GltfModel& m) { accessor(m, 0)["count"] = 5; },
     "accessors[0]: 5 elements need 60 bytes from byte 0 on, buffer view 0 has 48"},
    {"AnOffsetBeyondTheView",
     [](GltfModel& m) { accessor(m, 0)["byteOffset"] = 18446744073709551615U; },
     "accessors[0]: 4 elements need 48 bytes from byte 18446744073709551615 on"},
    {"AStrideBelowTheElement", [](GltfModel& m) { view(m, 0)["byteStride"] = 8; },
     "accessors[0].bufferView: byteStride 8 is less than an element's 12 bytes"},
    {"AHugeStride", [](GltfModel& m) { view(m, 0)["byteStride"] = 1000; },
     "bufferViews[0].byteStride: 1000, at most 252"},
    {"AViewBeyondTheBuffer", [](GltfModel& m) { view(m, 1)["byteLength"] = 1000000; },
     "bufferViews[1]: 1000000 bytes from byte 48 on exceed the buffer's"},
    {"AViewWhoseEndOverflows",
     [](GltfModel& m) { view(m, 1)["byteOffset"] = 18446744073709551615U; },
     "bufferViews[1]: 48 bytes from byte 18446744073709551615 on exceed"},
    {"ABufferThatIsNotThere", [](GltfModel& m) { view(m, 0)["buffer"] = 1; },
     "bufferViews[0].buffer: 1 of 1 buffers"},
    {"AnUnknownComponentType", [](GltfModel& m) { accessor(m, 0)["componentType"] = 5124; },
     "accessors[0].componentType: 5124 is no component type"},
    {"AnUnknownType", [](GltfModel& m) { accessor(m, 0)["type"] = "VEC5"; },
     "accessors[0].type: unknown"},
    {"PositionsOfTwoComponents",
     [](GltfModel& m) { m.attributes()["POSITION"] = m.attributes()["TEXCOORD_0"]; },
     "accessors[2].type: VEC2, expected VEC3"},
    {"NormalsOfAnotherNumber",
     [](GltfModel& m) {
       m.attributes()["NORMAL"] =
           m.add_accessor(std::vector<float>{0, 0, 1, 0, 0, 1}, "VEC3", kFloat);
     },
     "accessors[4].count: 2, expected 4"},
    {"AVertexThatIsNotThere",
     [](GltfModel& m) {
       m.primitive()["indices"] = m.add_accessor(std::vector<uint16_t>{0, 1, 4}, "SCALAR", kUshort);
     },
     "meshes[0].primitives[0].indices: element 2: 4 of 4 vertices"},
    {"IndicesOfFloats",
     [](GltfModel& m) {
       m.primitive()["indices"] = m.add_accessor(std::vector<float>{0, 1, 2}, "SCALAR", kFloat);
     },
     "accessors[4].componentType: indices need unsigned integers"},
    {"AVertexThatIsNotFinite",
     [](GltfModel& m) {
       const float nan = std::numeric_limits<float>::quiet_NaN();
       m.attributes()["POSITION"] =
           m.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, nan, 1, 0, 0, 1, 0}, "VEC3", kFloat);
     },
     "meshes[0].primitives[0].attributes.POSITION: mesh 'quad' vertex 2 is not finite"},
    {"AVertexTooFarAway",
     [](GltfModel& m) {
       m.attributes()["POSITION"] = m.add_accessor(
           std::vector<float>{0, 0, 0, 1, 0, 0, 1e20F, 1, 0, 0, 1, 0}, "VEC3", kFloat);
     },
     "mesh 'quad' vertex 2 is too far away"},
    {"AnUnknownMode", [](GltfModel& m) { m.primitive()["mode"] = 7; },
     "meshes[0].primitives[0].mode: 7 of 7 modes"},
    {"ASparseIndexThatIsNotThere",
     [](GltfModel& m) {
       accessor(m, 0)["sparse"] = {
           {"count", 1},
           {"indices",
            {{"bufferView", m.add_view(test::bytes_of(std::vector<uint32_t>{4}))},
             {"componentType", 5125}}},
           {"values", {{"bufferView", m.add_view(test::bytes_of(std::vector<float>{1, 1, 1}))}}}};
     },
     "accessors[0].sparse.indices: element 0: 4 of 4 elements"},
    {"MoreSparseValuesThanElements",
     [](GltfModel& m) {
       accessor(m, 0)["sparse"] = {{"count", 5}};
     },
     "accessors[0].sparse.count: 5, expected 1 to 4"},
    {"AMeshThatIsNotThere", [](GltfModel& m) { m.node()["mesh"] = 1; },
     "nodes[0].mesh: 1 of 1 meshes"},
    {"AMaterialThatIsNotThere", [](GltfModel& m) { m.primitive()["material"] = 0; },
     "meshes[0].primitives[0].material: 0 of 0 materials"},
    {"ATextureThatIsNotThere",
     [](GltfModel& m) {
       m.material()["normalTexture"] = {{"index", 3}};
     },
     "materials[0].normalTexture.index: 3 of 0 textures"},
    {"APictureThatIsNotThere",
     [](GltfModel& m) {
       m.json["textures"] = {{{"source", 2}}};
       m.material()["normalTexture"] = {{"index", 0}};
     },
     "textures[0].source: 2 of 0 images"},
    {"APictureOutsideItsBuffer",
     [](GltfModel& m) {
       m.material()["normalTexture"] = {{"index", m.add_texture()}};
       view(m, 4)["byteOffset"] = 1000000;
     },
     "bufferViews[4]:"},
    {"ANodeThatIsItsOwnChild", [](GltfModel& m) { m.node()["children"] = {0}; },
     "nodes[0]: is its own ancestor"},
    {"ACycleOfNodes",
     [](GltfModel& m) {
       m.json["nodes"].push_back({{"children", {2}}});
       m.json["nodes"].push_back({{"children", {1}}});
     },
     "nodes[1]: is its own ancestor"},
    {"ANodeWithTwoParents",
     [](GltfModel& m) {
       m.json["nodes"].push_back({{"children", {0}}});
       m.json["nodes"].push_back({{"children", {0}}});
     },
     "nodes[2].children: node 0 is also a child of node 1"},
    {"AChildThatIsNotThere", [](GltfModel& m) { m.node()["children"] = {7}; },
     "nodes[0].children[0]: 7 of 1 nodes"},
    {"ASceneThatIsNotThere", [](GltfModel& m) { m.json["scene"] = 1; }, "scene: 1 of 1 scenes"},
    {"AMatrixOfFifteenNumbers",
     [](GltfModel& m) { m.node()["matrix"] = std::vector<double>(15, 1.0); },
     "nodes[0].matrix: 15 numbers, expected 16"},
    {"ATransformThatIsNotFinite",
     [](GltfModel& m) {
       m.node()["translation"] = {1e308, 0, 0};
       m.node()["scale"] = {1e308, 1, 1};
       m.add_node({{"children", {0}}, {"scale", {1e308, 1, 1}}});
       m.json["scenes"][0]["nodes"] = {1};
     },
     "mesh 'quad': its node's transform is not finite"},
    {"AJointThatIsNotThere",
     [](GltfModel& m) {
       m.json["skins"] = {{{"joints", {0}}}};
       m.node()["skin"] = 0;
       m.attributes()["JOINTS_0"] = m.add_accessor(std::vector<uint16_t>(16, 9), "VEC4", kUshort);
       m.attributes()["WEIGHTS_0"] = m.add_accessor(std::vector<float>(16, 0.25F), "VEC4", kFloat);
     },
     "nodes[0].skin: mesh 'quad' vertex 0: joint 9 of 1 joints"},
    {"FewerMatricesThanJoints",
     [](GltfModel& m) {
       m.json["skins"] = {
           {{"joints", {0, 0}},
            {"inverseBindMatrices", m.add_accessor(std::vector<float>(16, 0.0F), "MAT4", kFloat)}}};
     },
     "skins[0].inverseBindMatrices: 1 matrices for 2 joints"},
    {"AMorphTargetOfAnotherSize",
     [](GltfModel& m) {
       m.primitive()["targets"] = {
           {{"POSITION", m.add_accessor(std::vector<float>(9, 0.0F), "VEC3", kFloat)}}};
     },
     "accessors[4].count: 3, expected 4"},
    {"HugeMorphTargets",
     [](GltfModel& m) {
       m.attributes() = {{"POSITION", m.add_accessor_at(-1, 1000000, "VEC3", kFloat)}};
       m.primitive()["targets"] = std::vector<json>(70, json::object());
     },
     "more than 67108864 triangles or 67108864 vertices in the scene"},
    {"KeysOfAnotherNumber",
     [](GltfModel& m) {
       m.animate(0, "translation", {0, 1, 2}, {0, 0, 0, 1, 1, 1}, "VEC3");
     },
     "accessors[5].count: 2, expected 3"},
    {"AKeyThatIsNotFinite",
     [](GltfModel& m) {
       m.animate(0, "translation", {0, std::numeric_limits<float>::infinity()}, {0, 0, 0, 1, 1, 1},
                 "VEC3");
     },
     "animations[0].samplers[0].input: key frame 1 is not finite or too late"},
    {"AnUnknownInterpolation",
     [](GltfModel& m) {
       m.animate(0, "scale", {0}, {1, 1, 1}, "VEC3", "BEZIER");
     },
     "animations[0].samplers[0].interpolation: expected LINEAR, STEP or CUBICSPLINE"},
    {"AnAnimatedNodeThatIsNotThere",
     [](GltfModel& m) {
       m.animate(9, "scale", {0}, {1, 1, 1}, "VEC3");
     },
     "animations[0].channels[0].target.node: 9 of 1 nodes"},
    {"AnAnimatedMatrix",
     [](GltfModel& m) {
       m.node()["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
       m.animate(0, "scale", {0}, {1, 1, 1}, "VEC3");
     },
     "animations[0].channels[0].target.node: node 0 has a matrix"},
    {"ALightThatIsNotThere",
     [](GltfModel& m) {
       m.node()["extensions"]["KHR_lights_punctual"] = {{"light", 0}};
     },
     "nodes[0].extensions.KHR_lights_punctual.light: 0 of 0 lights"},
    {"ACameraThatIsNotThere", [](GltfModel& m) { m.node()["camera"] = 2; },
     "nodes[0].camera: 2 of 0 cameras"},
    {"TooManyInstances",
     [](GltfModel& m) {
       m.node()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
           {"TRANSLATION", m.add_accessor_at(-1, 100000000, "VEC3", kFloat)}};
     },
     "accessors[4].count: 100000000 elements without a buffer view"},
    {"DamagedDracoData",
     [](GltfModel& m) {
       m.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
           {"bufferView", 0}, {"attributes", {{"POSITION", 0}}}};
     },
     "meshes[0].primitives[0].extensions.KHR_draco_mesh_compression: damaged Draco data"},
    {"ADracoBomb",
     [](GltfModel& m) {
       // Sequential, 2^27 - 1 faces.
       const ByteVector bomb{'D', 'R', 'A',  'C',  'O',  2,    2,    1,    0,
                             0,   0,   0xFF, 0xFF, 0xFF, 0x3F, 0x01, 0x00, 0x00};
       m.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
           {"bufferView", m.add_view(bomb)}, {"attributes", {{"POSITION", 0}}}};
     },
     "134217727 and 1 faces and vertices in 18 bytes of Draco data"},
    {"ADracoAttributeThatIsNotThere",
     [](GltfModel& m) {
       m.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
           {"bufferView", m.add_view(draco_quad())}, {"attributes", {{"POSITION", 77}}}};
     },
     "KHR_draco_mesh_compression.attributes.POSITION: 77 is no attribute"},
    {"DamagedMeshoptData", [](GltfModel& m) { add_meshopt(m, json::object()); },
     "bufferViews[0].extensions.EXT_meshopt_compression: damaged data"},
    {"AMeshoptBomb",
     [](GltfModel& m) {
       add_meshopt(m, {{"count", 1000000000}});
     },
     "EXT_meshopt_compression.count: 1000000000 elements of 12 bytes from 48 compressed bytes"},
    {"AMeshoptStrideOfThree",
     [](GltfModel& m) {
       add_meshopt(m, {{"byteStride", 3}});
     },
     "EXT_meshopt_compression.byteStride: 3 is no multiple of 4 up to 256"},
    {"AnUnknownMeshoptMode",
     [](GltfModel& m) {
       add_meshopt(m, {{"mode", "X"}, {"byteStride", 4}});
     },
     "EXT_meshopt_compression.mode: unknown"},
    {"ABufferInAnotherFile",
     [](GltfModel& m) {
       m.json["buffers"] = {{{"byteLength", 48}, {"uri", "/etc/hostname"}}};
       view(m, 0)["buffer"] = 1;
     },
     "buffers[1].uri: other files are not read"},
    {"ABufferOnTheNet",
     [](GltfModel& m) {
       m.json["buffers"] = {{{"byteLength", 48}, {"uri", "https://example.com/a.bin"}}};
       view(m, 0)["buffer"] = 1;
     },
     "buffers[1].uri: only files and data URIs are read"},
    {"ABufferLongerThanItsData",
     [](GltfModel& m) {
       m.json["buffers"] = {{{"byteLength", 48}, {"uri", "data:;base64,AAAA"}}};
       view(m, 0)["buffer"] = 1;
     },
     "buffers[1].byteLength: 48, but there are 3 bytes"},
    {"DamagedBase64",
     [](GltfModel& m) {
       m.json["buffers"] = {{{"byteLength", 3}, {"uri", "data:;base64,A*AA"}}};
       view(m, 0)["buffer"] = 1;
     },
     "buffers[1].uri: damaged base64 data"},
    {"AnOldVersion", [](GltfModel& m) { m.json["asset"]["version"] = "1.0"; },
     "asset.version: glTF 1.0, expected 2"},
    {"NoVersion", [](GltfModel& m) { m.json.erase("asset"); }, "asset is missing"},
    {"AnUnknownRequiredExtension", [](GltfModel& m) { m.require("VENDOR_new_geometry"); },
     "extensionsRequired[0]: unknown extension 'VENDOR_new_geometry'"},
    {"RequiredKtx2", [](GltfModel& m) { m.require("KHR_texture_basisu"); },
     "extensionsRequired[0]: KHR_texture_basisu: KTX2 textures are not read"},
    {"NodesThatAreNoArray", [](GltfModel& m) { m.json["nodes"] = 5; }, "nodes: not an array"},
    {"NothingToSee", [](GltfModel& m) { m.json["scenes"][0]["nodes"] = json::array(); },
     "nothing to see in this scene"},
    {"DeepJson",
     [](GltfModel& m) {
       json deep = 1;
       for (int i = 0; i < 100; ++i) deep = json::array({deep});
       m.json["extras"] = deep;
     },
     "JSON nested deeper than 64 levels"},
};

class GltfAttack : public ::testing::TestWithParam<Attack> {};

TEST_P(GltfAttack, IsRefusedWithThePathOfTheValue) {
  GltfModel model;
  GetParam().change(model);
  const Error error = error_of([&] { (void)parse_gltf(model.gltf(), "model.gltf", std::nullopt); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_THAT(error.what(), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(Hostile, GltfAttack, ::testing::ValuesIn(kAttacks),
                         [](const auto& info) { return std::string(info.param.name); });

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
