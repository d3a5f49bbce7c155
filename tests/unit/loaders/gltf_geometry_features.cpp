// SPDX-License-Identifier: Apache-2.0
// Features of glTF: primitives, attributes of vertices, and compressed meshes.
#include "tests/unit/loaders/gltf_features.h"

namespace lenticule::render {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using namespace lenticule::test;

}  // namespace

std::vector<GltfFeatureCase> gltf_geometry_features() {
  return {
      {"Quad", [](GltfModel&) {},
       [](const SceneDescription& scene) {
         expect_quad(scene);
         EXPECT_THAT(scene.notes, IsEmpty());
         EXPECT_THAT(only_mesh(scene).uvs[0], ElementsAre(0.0F, 1.0F));
         expect_close(only_mesh(scene).normals[2], {0, 0, 1});
         EXPECT_EQ(pbr_of(scene).metallic, 1.0) << "the default material";
       }},
      {"IndicesOfBytes",
       [](GltfModel& m) {
         m.primitive()["indices"] =
             m.add_accessor(std::vector<uint8_t>{0, 1, 2, 0, 2, 3}, "SCALAR", kUbyte);
       },
       [](const SceneDescription& s) { expect_quad(s); }},
      {"IndicesOf32Bits",
       [](GltfModel& m) {
         m.primitive()["indices"] =
             m.add_accessor(std::vector<uint32_t>{0, 1, 2, 0, 2, 3}, "SCALAR", kUint);
       },
       [](const SceneDescription& s) { expect_quad(s); }},
      {"NoIndices",
       [](GltfModel& m) {
         m.primitive().erase("indices");
         m.attributes() = {
             {"POSITION",
              m.add_accessor(std::vector<float>{0, 0, 0, 2, 0, 0, 0, 2, 0}, "VEC3", kFloat)}};
       },
       [](const SceneDescription& s) {
         expect_area(s, 2.0);
         EXPECT_THAT(only_mesh(s).normals, IsEmpty()) << "without normals faces are flat";
       }},
      {"TriangleStrip",
       [](GltfModel& m) {
         m.primitive()["mode"] = 5;
         m.primitive()["indices"] =
             m.add_accessor(std::vector<uint16_t>{0, 1, 3, 2}, "SCALAR", kUshort);
       },
       [](const SceneDescription& s) { expect_area(s, 1.0); }},
      {"TriangleFan",
       [](GltfModel& m) {
         m.primitive()["mode"] = 6;
         m.primitive()["indices"] =
             m.add_accessor(std::vector<uint16_t>{0, 1, 2, 3}, "SCALAR", kUshort);
       },
       [](const SceneDescription& s) { expect_area(s, 1.0); }},
      {"PointsAndLinesAreCounted",
       [](GltfModel& m) {
         for (const int mode : {0, 1, 3}) {
           json primitive = m.primitive();
           primitive["mode"] = mode;
           m.json["meshes"][0]["primitives"].push_back(primitive);
         }
       },
       [](const SceneDescription& s) {
         expect_quad(s);
         EXPECT_THAT(s.notes, ElementsAre("3 primitives of points or lines left out"));
       }},
      {"InterleavedAttributes",
       [](GltfModel& m) {
         const std::vector<float> both{0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1,
                                       1, 1, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1};
         const int view = m.add_view(test::bytes_of(both), 24);
         m.attributes()["POSITION"] = m.add_accessor_at(view, 4, "VEC3", kFloat);
         m.attributes()["NORMAL"] =
             m.add_accessor_at(view, 4, "VEC3", kFloat, {{"byteOffset", 12}});
       },
       [](const SceneDescription& s) {
         expect_quad(s);
         expect_close(only_mesh(s).normals[3], {0, 0, 1});
       }},
      {"SparseValues",
       [](GltfModel& m) {
         const int indices = m.add_view(test::bytes_of(std::vector<uint16_t>{2}));
         const int values = m.add_view(test::bytes_of(std::vector<float>{1, 3, 0}));
         m.json["accessors"][0]["sparse"] = {
             {"count", 1},
             {"indices", {{"bufferView", indices}, {"componentType", 5123}}},
             {"values", {{"bufferView", values}}}};
       },
       [](const SceneDescription& s) {
         expect_close(only_mesh(s).positions[2], {1, 3, 0});
       }},
      {"SparseValuesOverZeros",
       [](GltfModel& m) {
         const int indices = m.add_view(test::bytes_of(std::vector<uint8_t>{1, 2, 3}));
         const int values =
             m.add_view(test::bytes_of(std::vector<float>{1, 0, 0, 1, 1, 0, 0, 1, 0}));
         m.attributes()["POSITION"] =
             m.add_accessor_at(-1, 4, "VEC3", kFloat,
                               {{"sparse",
                                 {{"count", 3},
                                  {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                                  {"values", {{"bufferView", values}}}}}});
       },
       [](const SceneDescription& s) { expect_quad(s); }},
      {"QuantizedAttributes",
       [](GltfModel& m) {
         m.require("KHR_mesh_quantization");
         // The node scales back; strides are multiples of four.
         m.attributes()["POSITION"] = m.add_accessor_at(
             m.add_view(test::bytes_of(std::vector<int16_t>{0, 0, 0, 0, 100, 0, 0, 0, 100, 100, 0,
                                                            0, 0, 100, 0, 0}),
                        8),
             4, "VEC3", kShort);
         m.attributes()["NORMAL"] = m.add_accessor_at(
             m.add_view(test::bytes_of(std::vector<int8_t>{0, 0, 127, 0, 0, 0, 127, 0, 0, 0, 127, 0,
                                                           0, 0, 127, 0}),
                        4),
             4, "VEC3", kByte, {{"normalized", true}});
         m.attributes()["TEXCOORD_0"] =
             m.add_accessor(std::vector<uint16_t>{0, 65535, 65535, 65535, 65535, 0, 0, 0}, "VEC2",
                            kUshort, {{"normalized", true}});
         m.node()["scale"] = {0.01, 0.01, 0.01};
       },
       [](const SceneDescription& s) {
         expect_quad(s);
         EXPECT_THAT(only_mesh(s).uvs[1], ElementsAre(1.0F, 1.0F));
         expect_close(only_mesh(s).normals[0], {0, 0, 1});
       }},
      {"VertexColours",
       [](GltfModel& m) {
         m.attributes()["COLOR_0"] = m.add_accessor(
             std::vector<uint8_t>{255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 51, 0, 0, 0, 0},
             "VEC4", kUbyte, {{"normalized", true}});
       },
       [](const SceneDescription& s) {
         const auto& colours = only_mesh(s).colours;
         ASSERT_THAT(colours, SizeIs(4));
         EXPECT_THAT(colours[0], ElementsAre(1.0F, 0.0F, 0.0F, 1.0F));
         EXPECT_NEAR(colours[2][3], 0.2, 1e-6);
       }},
      {"VertexColoursWithoutAlpha",
       [](GltfModel& m) {
         m.attributes()["COLOR_0"] = m.add_accessor(
             std::vector<float>{0.5F, 0, 0, 0.5F, 0, 0, 0.5F, 0, 0, 0.5F, 0, 0}, "VEC3", kFloat);
       },
       [](const SceneDescription& s) {
         EXPECT_THAT(only_mesh(s).colours.at(3), ElementsAre(0.5F, 0.0F, 0.0F, 1.0F));
       }},
      {"TangentsOfTheFile",
       [](GltfModel& m) {
         m.attributes()["TANGENT"] =
             m.add_accessor(std::vector<float>{0, 2, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1},
                            "VEC4", kFloat);
       },
       [](const SceneDescription& s) {
         EXPECT_THAT(only_mesh(s).tangents.at(0), ElementsAre(0.0F, 1.0F, 0.0F, -1.0F));
       }},
      {"TangentsAreComputedForNormalTextures",
       [](GltfModel& m) { m.material()["normalTexture"] = texture_info(m.add_texture()); },
       [](const SceneDescription& s) {
         ASSERT_THAT(only_mesh(s).tangents, SizeIs(4));
         for (const auto& t : only_mesh(s).tangents) EXPECT_THAT(t, ElementsAre(1, 0, 0, 1));
       }},
      {"MirroredTexturesHaveOppositeBitangents",
       [](GltfModel& m) {
         m.material()["normalTexture"] = texture_info(m.add_texture());
         m.attributes()["TEXCOORD_0"] =
             m.add_accessor(std::vector<float>{1, 1, 0, 1, 0, 0, 1, 0}, "VEC2", kFloat);
       },
       [](const SceneDescription& s) {
         for (const auto& t : only_mesh(s).tangents) EXPECT_THAT(t, ElementsAre(-1, 0, 0, -1));
       }},
      {"DracoMesh",
       [](GltfModel& m) {
         m.require("KHR_draco_mesh_compression");
         const int view = m.add_view(draco_quad());
         m.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
             {"bufferView", view},
             {"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}}};
         for (size_t i = 0; i < 4; ++i) m.json["accessors"][i].erase("bufferView");
       },
       [](const SceneDescription& s) {
         expect_area(s, 1.0);
         EXPECT_THAT(only_mesh(s).positions, SizeIs(4));
         for (size_t i = 0; i < 4; ++i) {
           const Vec3 p = only_mesh(s).positions[i];
           EXPECT_NEAR(only_mesh(s).uvs[i][0], p.x, 1e-3);
           EXPECT_NEAR(only_mesh(s).uvs[i][1], 1.0 - p.y, 1e-3);
         }
       }},
      {"MeshoptBuffers",
       [](GltfModel& m) {
         m.require("EXT_meshopt_compression");
         const auto compress = [&](size_t accessor, const ByteVector& data, int count, int stride,
                                   const char* mode) {
           const int from = m.add_view(data);
           json compressed = m.json["bufferViews"][static_cast<size_t>(from)];
           compressed["count"] = count;
           compressed["byteStride"] = stride;
           compressed["mode"] = mode;
           m.json["bufferViews"].push_back(
               {{"buffer", 1},
                {"byteLength", count * stride},
                {"extensions", {{"EXT_meshopt_compression", compressed}}}});
           m.json["accessors"][accessor]["bufferView"] = m.json["bufferViews"].size() - 1;
         };
         const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
         compress(0, meshopt_vertices(test::bytes_of(positions), 12), 4, 12, "ATTRIBUTES");
         compress(3, meshopt_triangles({0, 1, 2, 0, 2, 3}, 4), 6, 2, "TRIANGLES");
         // The fallback buffer has no bytes in the file.
         m.json["buffers"] = {
             {{"byteLength", 1000},
              {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
       },
       [](const SceneDescription& s) { expect_area(s, 1.0); }},
  };
}

}  // namespace lenticule::render
