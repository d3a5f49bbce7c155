// SPDX-License-Identifier: Apache-2.0
// Tests the import of glTF with small generated models: one case per feature.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "render/loaders/gltf_loader.h"
#include "tests/support/gltf_model.h"
#include "tests/support/texels.h"

namespace lenticule::render {
namespace {

using nlohmann::json;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using namespace lenticule::test;

using Change = std::function<void(GltfModel&)>;
using Expect = std::function<void(const SceneDescription&)>;

/// A feature: how the quad is changed, and what the loader makes of it.
struct Feature {
  const char* name;
  Change change;
  Expect expect;
};

void expect_near(Vec3 a, Vec3 b, double tolerance = 1e-5) {
  EXPECT_LT(length(a - b), tolerance) << a.x << ' ' << a.y << ' ' << a.z;
}

const TriangleMesh& only_mesh(const SceneDescription& scene) {
  EXPECT_THAT(scene.meshes, SizeIs(1));
  return scene.meshes.at(0);
}

const PbrMaterial& pbr_of(const SceneDescription& scene) {
  return *scene.materials.at(static_cast<size_t>(only_mesh(scene).material)).pbr;
}

/// Expects the quad as the model's constructor makes it.
void expect_quad(const SceneDescription& scene, double tolerance = 1e-6) {
  const TriangleMesh& mesh = only_mesh(scene);
  ASSERT_THAT(mesh.positions, SizeIs(4));
  expect_near(mesh.positions[0], {0, 0, 0}, tolerance);
  expect_near(mesh.positions[1], {1, 0, 0}, tolerance);
  expect_near(mesh.positions[2], {1, 1, 0}, tolerance);
  expect_near(mesh.positions[3], {0, 1, 0}, tolerance);
  EXPECT_THAT(mesh.triangles,
              ElementsAre(std::array<uint32_t, 3>{0, 1, 2}, std::array<uint32_t, 3>{0, 2, 3}));
}

/// Expects triangles of this total area that face +z.
void expect_area(const SceneDescription& scene, double area) {
  double sum = 0.0;
  for (const TriangleMesh& mesh : scene.meshes)
    for (const auto& [a, b, c] : mesh.triangles)
      sum += cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]).z;
  EXPECT_NEAR(sum / 2.0, area, 1e-5);
}

json texture_info(int texture) {
  return {{"index", texture}};
}

/// Sets an extension of the material and names it as used.
void set_extension(GltfModel& model, const std::string& name, const json& content) {
  model.material()["extensions"][name] = content;
  model.json["extensionsUsed"].push_back(name);
}

std::vector<float> matrix_moved_by(float x) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 0, 1};
}

/// Gives the quad two joints: the left vertices follow the first, the right ones the second.
void add_skin(GltfModel& model) {
  const int first = model.add_node({{"name", "first"}});
  const int second = model.add_node({{"name", "second"}, {"translation", {5, 0, 0}}});
  std::vector<float> matrices = matrix_moved_by(0);
  const std::vector<float> inverse = matrix_moved_by(-5);
  matrices.insert(matrices.end(), inverse.begin(), inverse.end());
  model.json["skins"] = {{{"joints", {first, second}},
                          {"inverseBindMatrices", model.add_accessor(matrices, "MAT4", kFloat)}}};
  model.attributes()["JOINTS_0"] = model.add_accessor(
      std::vector<uint8_t>{0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, "VEC4", kUbyte);
  model.attributes()["WEIGHTS_0"] = model.add_accessor(
      std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0}, "VEC4", kFloat);
  model.node()["skin"] = 0;
}

void add_morph_targets(GltfModel& model) {
  const int up =
      model.add_accessor(std::vector<float>{0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 2, 0}, "VEC3", kFloat);
  const int out =
      model.add_accessor(std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3", kFloat);
  model.primitive()["targets"] = {{{"POSITION", up}}, {{"POSITION", out}}};
}

const std::vector<Feature> kGeometry{
    {"Quad", [](GltfModel&) {},
     [](const SceneDescription& scene) {
       expect_quad(scene);
       EXPECT_THAT(scene.notes, IsEmpty());
       EXPECT_THAT(only_mesh(scene).uvs[0], ElementsAre(0.0F, 1.0F));
       expect_near(only_mesh(scene).normals[2], {0, 0, 1});
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
       m.attributes() = {{"POSITION", m.add_accessor(std::vector<float>{0, 0, 0, 2, 0, 0, 0, 2, 0},
                                                     "VEC3", kFloat)}};
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
       m.attributes()["NORMAL"] = m.add_accessor_at(view, 4, "VEC3", kFloat, {{"byteOffset", 12}});
     },
     [](const SceneDescription& s) {
       expect_quad(s);
       expect_near(only_mesh(s).normals[3], {0, 0, 1});
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
       expect_near(only_mesh(s).positions[2], {1, 3, 0});
     }},
    {"SparseValuesOverZeros",
     [](GltfModel& m) {
       const int indices = m.add_view(test::bytes_of(std::vector<uint8_t>{1, 2, 3}));
       const int values = m.add_view(test::bytes_of(std::vector<float>{1, 0, 0, 1, 1, 0, 0, 1, 0}));
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
           m.add_view(test::bytes_of(std::vector<int16_t>{0, 0, 0, 0, 100, 0, 0, 0, 100, 100, 0, 0,
                                                          0, 100, 0, 0}),
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
       expect_near(only_mesh(s).normals[0], {0, 0, 1});
     }},
    {"VertexColours",
     [](GltfModel& m) {
       m.attributes()["COLOR_0"] = m.add_accessor(
           std::vector<uint8_t>{255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 51, 0, 0, 0, 0}, "VEC4",
           kUbyte, {{"normalized", true}});
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
       m.attributes()["TANGENT"] = m.add_accessor(
           std::vector<float>{0, 2, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1, 0, 1, 0, -1}, "VEC4", kFloat);
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
       m.json["buffers"] = {{{"byteLength", 1000},
                             {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
     },
     [](const SceneDescription& s) { expect_area(s, 1.0); }},
};

const std::vector<Feature> kNodes{
    {"NodeMatrix",
     [](GltfModel& m) { m.node()["matrix"] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 5, 6, 7, 1}; },
     [](const SceneDescription& s) {
       expect_near(only_mesh(s).positions[2], {7, 8, 7});
     }},
    {"TranslationRotationScale",
     [](GltfModel& m) {
       m.node()["translation"] = {1, 2, 3};
       m.node()["rotation"] = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};
       m.node()["scale"] = {2, 1, 1};
     },
     [](const SceneDescription& s) {
       expect_near(only_mesh(s).positions[1], {1, 4, 3});
       expect_near(only_mesh(s).positions[3], {0, 2, 3});
     }},
    {"NegativeScaleKeepsTheFrontSide",
     [](GltfModel& m) {
       m.node()["scale"] = {-1, 1, 1};
     },
     [](const SceneDescription& s) {
       expect_near(only_mesh(s).positions[1], {-1, 0, 0});
       expect_area(s, 1.0);
       expect_near(only_mesh(s).normals[0], {0, 0, 1});
     }},
    {"ChildrenFollowTheirParents",
     [](GltfModel& m) {
       const int parent = m.add_node({{"translation", {10, 0, 0}}, {"children", {0}}});
       m.json["scenes"][0]["nodes"] = {parent};
     },
     [](const SceneDescription& s) {
       expect_near(only_mesh(s).positions[0], {10, 0, 0});
     }},
    {"TheStatedSceneIsShown",
     [](GltfModel& m) {
       m.json["nodes"].push_back({{"mesh", 0}, {"translation", {3, 0, 0}}});
       m.json["scenes"].push_back({{"nodes", {1}}});
       m.json["scene"] = 1;
     },
     [](const SceneDescription& s) {
       expect_near(only_mesh(s).positions[0], {3, 0, 0});
       EXPECT_THAT(s.notes, Contains(HasSubstr("further scenes")));
     }},
    {"Instances",
     [](GltfModel& m) {
       m.require("EXT_mesh_gpu_instancing");
       const int at = m.add_accessor(std::vector<float>{0, 0, 0, 5, 0, 0, 0, 5, 0}, "VEC3", kFloat);
       const int scale =
           m.add_accessor(std::vector<float>{1, 1, 1, 2, 2, 2, 3, 3, 3}, "VEC3", kFloat);
       m.node()["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {{"TRANSLATION", at},
                                                                          {"SCALE", scale}};
       m.node()["translation"] = {0, 0, 1};
     },
     [](const SceneDescription& s) {
       ASSERT_THAT(s.meshes, SizeIs(3));
       expect_near(s.meshes[1].positions[2], {7, 2, 1});
       expect_near(s.meshes[2].positions[2], {3, 8, 1});
     }},
    {"PerspectiveCamera",
     [](GltfModel& m) {
       m.json["cameras"] = {
           {{"type", "perspective"}, {"perspective", {{"yfov", 0.5}, {"znear", 0.25}}}}};
       m.add_node({{"camera", 0}, {"name", "view"}, {"translation", {0.5, 0.5, 4}}});
     },
     [](const SceneDescription& s) {
       ASSERT_THAT(s.cameras, SizeIs(1));
       EXPECT_EQ(s.cameras[0].name, "view");
       expect_near(s.cameras[0].from, {0.5, 0.5, 4});
       expect_near(s.cameras[0].at, {0.5, 0.5, 0});
       EXPECT_NEAR(s.cameras[0].vertical_fov_degrees, 0.5 * 180.0 / std::numbers::pi, 1e-9);
       EXPECT_EQ(s.cameras[0].hither, 0.25);
     }},
    {"OrthographicCamerasShowTheSameHeight",
     [](GltfModel& m) {
       m.json["cameras"] = {
           {{"type", "orthographic"},
            {"orthographic", {{"xmag", 2}, {"ymag", 3}, {"znear", 0}, {"zfar", 10}}}}};
       m.add_node({{"camera", 0}, {"name", "plan"}, {"translation", {0, 0, 4}}});
     },
     [](const SceneDescription& s) {
       ASSERT_THAT(s.cameras, SizeIs(1));
       const double half = s.cameras[0].vertical_fov_degrees / 2.0 * std::numbers::pi / 180.0;
       EXPECT_NEAR(4.0 * std::tan(half), 3.0, 1e-9);
       EXPECT_THAT(s.notes, Contains(HasSubstr("orthographic camera 'plan'")));
     }},
    {"Lights",
     [](GltfModel& m) {
       m.require("KHR_lights_punctual");
       m.json["extensions"]["KHR_lights_punctual"]["lights"] = {
           {{"type", "directional"}, {"intensity", 2}},
           {{"type", "point"}, {"color", {1, 0, 0}}, {"range", 5}},
           {{"type", "spot"}, {"spot", {{"innerConeAngle", 0.1}, {"outerConeAngle", 0.2}}}}};
       for (int i = 0; i < 3; ++i)
         m.add_node({{"translation", {0, 0, 2}},
                     {"extensions", {{"KHR_lights_punctual", {{"light", i}}}}}});
     },
     [](const SceneDescription& s) {
       ASSERT_THAT(s.lights, SizeIs(3));
       EXPECT_EQ(s.lights[0].kind, Light::Kind::Directional);
       expect_near(s.lights[0].direction, {0, 0, -1});
       EXPECT_NEAR(s.lights[0].colour.x, 2.0 * s.light_scale, 1e-9);
       EXPECT_LT(s.light_scale, 0.65);
       EXPECT_FALSE(s.lights[0].falls_off);
       EXPECT_EQ(s.lights[1].kind, Light::Kind::Point);
       EXPECT_EQ(s.lights[1].colour.y, 0.0);
       EXPECT_TRUE(s.lights[1].falls_off);
       expect_near(s.lights[2].position, {0, 0, 2});
       EXPECT_NEAR(s.lights[2].cos_inner, std::cos(0.1), 1e-9);
       EXPECT_NEAR(s.lights[2].cos_outer, std::cos(0.2), 1e-9);
       EXPECT_THAT(s.notes, Contains(HasSubstr("1 light ranges ignored")));
     }},
};

const std::vector<Feature> kMotion{
    {"LinearKeys",
     [](GltfModel& m) {
       m.animate(0, "translation", {0, 2}, {0, 0, 0, 4, 0, 0}, "VEC3");
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(s.duration_seconds, 2.0);
       expect_near(at_time(s, 0.5).meshes[0].positions[0], {1, 0, 0});
     }},
    {"SteppedKeys",
     [](GltfModel& m) {
       m.animate(0, "scale", {0, 1}, {1, 1, 1, 3, 3, 3}, "VEC3", "STEP");
     },
     [](const SceneDescription& s) {
       expect_near(at_time(s, 0.99).meshes[0].positions[2], {1, 1, 0});
       expect_near(at_time(s, 1.0).meshes[0].positions[2], {3, 3, 0});
     }},
    {"CubicSplines",
     [](GltfModel& m) {
       // From 0 to 1 in two seconds, leaving with velocity 3 and arriving with velocity 0.
       m.animate(0, "translation", {0, 2}, {0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0},
                 "VEC3", "CUBICSPLINE");
     },
     [](const SceneDescription& s) {
       // Half way: 1/2 * 0 + 1/8 * 2 * 3 + 1/2 * 1 - 1/8 * 2 * 0.
       expect_near(at_time(s, 1.0).meshes[0].positions[0], {1.25, 0, 0});
       expect_near(at_time(s, 2.0).meshes[0].positions[0], {1, 0, 0});
     }},
    {"RotationKeys",
     [](GltfModel& m) {
       const float half = std::sqrt(0.5F);
       m.animate(0, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, half, half}, "VEC4");
     },
     [](const SceneDescription& s) {
       const double c = std::sqrt(0.5);
       expect_near(at_time(s, 0.5).meshes[0].positions[1], {c, c, 0});
     }},
    {"NormalizedRotationKeys",
     [](GltfModel& m) {
       m.animate(0, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0}, "VEC4");
       m.json["animations"][0]["samplers"][0]["output"] =
           m.add_accessor(std::vector<int16_t>{0, 0, 0, 32767, 0, 0, 32767, 0}, "VEC4", kShort,
                          {{"normalized", true}});
     },
     [](const SceneDescription& s) {
       expect_near(at_time(s, 1.0).meshes[0].positions[1], {-1, 0, 0});
     }},
    {"SeveralAnimationsAreNoted",
     [](GltfModel& m) {
       m.animate(0, "translation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3");
       m.json["animations"].push_back(m.json["animations"][0]);
     },
     [](const SceneDescription& s) {
       EXPECT_THAT(s.notes, Contains("2 animations, the first is played"));
     }},
    {"MorphTargetsWithTheMeshsWeights",
     [](GltfModel& m) {
       add_morph_targets(m);
       m.json["meshes"][0]["weights"] = {0.5, 1};
     },
     [](const SceneDescription& s) {
       EXPECT_THAT(s.nodes, IsEmpty());
       expect_near(only_mesh(s).positions[1], {1, 0, 1});
       expect_near(only_mesh(s).positions[2], {1, 2, 1});
     }},
    {"MorphTargetsWithTheNodesWeights",
     [](GltfModel& m) {
       add_morph_targets(m);
       m.json["meshes"][0]["weights"] = {0.5, 1};
       m.node()["weights"] = {0, 2};
     },
     [](const SceneDescription& s) {
       expect_near(only_mesh(s).positions[2], {1, 1, 2});
     }},
    {"AnimatedMorphWeights",
     [](GltfModel& m) {
       add_morph_targets(m);
       m.animate(0, "weights", {0, 1}, {0, 0, 1, 0.5F}, "SCALAR");
     },
     [](const SceneDescription& s) {
       expect_near(at_time(s, 0.0).meshes[0].positions[2], {1, 1, 0});
       expect_near(at_time(s, 0.5).meshes[0].positions[2], {1, 2, 0.25});
     }},
    {"Skin", add_skin,
     [](const SceneDescription& s) {
       EXPECT_THAT(s.nodes, IsEmpty()) << "nothing moves";
       expect_quad(s);
     }},
    {"AnimatedSkin",
     [](GltfModel& m) {
       add_skin(m);
       m.node()["translation"] = {100, 0, 0};  // does not move a skinned mesh
       m.animate(2, "translation", {0, 1}, {5, 0, 0, 6, 0, 0}, "VEC3");
     },
     [](const SceneDescription& s) {
       const SceneDescription moved = at_time(s, 1.0);
       expect_near(moved.meshes[0].positions[0], {0, 0, 0});
       expect_near(moved.meshes[0].positions[1], {2, 0, 0});
       expect_near(moved.meshes[0].positions[2], {2, 1, 0});
     }},
    {"AMorphedTriangleMayStartWithoutAnArea",
     [](GltfModel& m) {
       m.attributes()["POSITION"] =
           m.add_accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0}, "VEC3", kFloat);
       add_morph_targets(m);
       m.animate(0, "weights", {0, 1}, {0, 0, 0.5F, 0}, "SCALAR");
     },
     [](const SceneDescription& s) { expect_area(at_time(s, 1.0), 1.0); }},
};

const std::vector<Feature> kMaterials{
    {"CoreFactors",
     [](GltfModel& m) {
       m.material()["pbrMetallicRoughness"] = {{"baseColorFactor", {0.25, 0.5, 0.75, 0.5}},
                                               {"metallicFactor", 0.125},
                                               {"roughnessFactor", 0.375}};
       m.material()["emissiveFactor"] = {0.5, 0.25, 0};
       m.material()["alphaMode"] = "BLEND";
       m.material()["doubleSided"] = true;
     },
     [](const SceneDescription& s) {
       const PbrMaterial& p = pbr_of(s);
       EXPECT_EQ(p.base_colour, (Vec3{0.25, 0.5, 0.75}));
       EXPECT_EQ(p.alpha, 0.5);
       EXPECT_EQ(p.metallic, 0.125);
       EXPECT_EQ(p.roughness, 0.375);
       EXPECT_EQ(p.emission, (Vec3{0.5, 0.25, 0}));
       EXPECT_EQ(p.alpha_mode, PbrMaterial::AlphaMode::Blend);
       EXPECT_TRUE(p.double_sided);
       EXPECT_EQ(s.materials[0].transmittance, 0.5) << "Whitted's approximation";
     }},
    {"AlphaMask",
     [](GltfModel& m) {
       m.material()["alphaMode"] = "MASK";
       m.material()["alphaCutoff"] = 0.25;
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).alpha_mode, PbrMaterial::AlphaMode::Mask);
       EXPECT_EQ(pbr_of(s).alpha_cutoff, 0.25);
     }},
    {"CoreTextures",
     [](GltfModel& m) {
       const int texture = m.add_texture();
       json& material = m.material();
       material["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(texture)},
                                           {"metallicRoughnessTexture", texture_info(texture)}};
       material["normalTexture"] = {{"index", texture}, {"scale", 0.5}};
       material["occlusionTexture"] = {{"index", texture}, {"strength", 0.25}};
       material["emissiveTexture"] = texture_info(texture);
     },
     [](const SceneDescription& s) {
       const PbrMaterial& p = pbr_of(s);
       ASSERT_THAT(s.textures, SizeIs(2)) << "as colours and as data";
       EXPECT_EQ(p.base_colour_texture.texture, p.emission_texture.texture);
       EXPECT_EQ(p.normal_texture.texture, p.metallic_roughness_texture.texture);
       EXPECT_EQ(p.normal_texture.texture, p.occlusion_texture.texture);
       EXPECT_EQ(p.normal_scale, 0.5);
       EXPECT_EQ(p.occlusion_strength, 0.25);
       const auto grey = [&](const TextureUse& use, frames::TextureContent content) {
         return testing::texels_of(*s.textures[static_cast<size_t>(use.texture)], content)[12];
       };
       EXPECT_NEAR(grey(p.base_colour_texture, frames::TextureContent::Colour), 0.5029, 1e-4)
           << "decoded from sRGB";
       EXPECT_NEAR(grey(p.normal_texture, frames::TextureContent::Data), 188.0 / 255.0, 1e-6)
           << "as it is";
       EXPECT_NEAR(testing::texels_of(*s.textures[0])[11], 128.0 / 255.0, 1e-6) << "alpha";
     }},
    {"TheTextureOfTheSecondCoordinates",
     [](GltfModel& m) {
       m.attributes()["TEXCOORD_1"] =
           m.add_accessor(std::vector<float>{0, 0, 0.5F, 0, 0.5F, 0.5F, 0, 0.5F}, "VEC2", kFloat);
       const int texture = m.add_texture();
       m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(texture)}};
       m.material()["occlusionTexture"] = {{"index", texture}, {"texCoord", 1}};
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).base_colour_texture.uv_set, 0);
       EXPECT_EQ(pbr_of(s).occlusion_texture.uv_set, 1);
       EXPECT_THAT(only_mesh(s).uvs[2], ElementsAre(1.0F, 0.0F));
       EXPECT_THAT(only_mesh(s).uvs2[2], ElementsAre(0.5F, 0.5F));
     }},
    {"ABaseColourWithTheSecondCoordinates",
     [](GltfModel& m) {
       m.attributes()["TEXCOORD_1"] =
           m.add_accessor(std::vector<float>{0, 0, 0.5F, 0, 0.5F, 0.5F, 0, 0.5F}, "VEC2", kFloat);
       m.material()["pbrMetallicRoughness"] = {
           {"baseColorTexture", {{"index", m.add_texture()}, {"texCoord", 1}}}};
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).base_colour_texture.uv_set, 0) << "the first set that is used";
       EXPECT_THAT(only_mesh(s).uvs[2], ElementsAre(0.5F, 0.5F));
     }},
    {"SamplersWrap",
     [](GltfModel& m) {
       m.material()["pbrMetallicRoughness"] = {
           {"baseColorTexture", texture_info(m.add_texture({{"wrapS", 33071}, {"wrapT", 33648}}))}};
     },
     [](const SceneDescription& s) {
       EXPECT_FALSE(s.textures.at(0)->repeat_u);
       EXPECT_TRUE(s.textures[0]->repeat_v);
       EXPECT_TRUE(s.textures[0]->mirror_v);
       EXPECT_FALSE(s.textures[0]->mirror_u);
     }},
    {"TextureTransform",
     [](GltfModel& m) {
       m.require("KHR_texture_transform");
       json info = texture_info(m.add_texture());
       info["extensions"]["KHR_texture_transform"] = {
           {"offset", {0.5, 0.25}}, {"rotation", std::numbers::pi / 2}, {"scale", {2, 3}}};
       m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", info}};
     },
     [](const SceneDescription& s) {
       const auto& map = pbr_of(s).base_colour_texture.uv_map;
       // (1, 0) turns counter-clockwise, as seen, to (0, -1): v points down.
       EXPECT_NEAR(map[0] * 1 + map[2], 0.5, 1e-9);
       EXPECT_NEAR(map[3] * 1 + map[5], 0.25 - 2, 1e-9);
       EXPECT_NEAR(map[1] * 1 + map[2], 0.5 + 3, 1e-9);
       EXPECT_NEAR(map[4] * 1 + map[5], 0.25, 1e-9);
     }},
    {"WebpTexture",
     [](GltfModel& m) {
       m.require("EXT_texture_webp");
       m.json["images"] = {{{"bufferView", m.add_view(small_webp())}, {"mimeType", "image/webp"}}};
       m.json["textures"] = {{{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}}};
       m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(0)}};
     },
     [](const SceneDescription& s) {
       ASSERT_THAT(s.textures, SizeIs(1)) << ::testing::PrintToString(s.notes);
       EXPECT_EQ(s.textures[0]->width, 2);
       EXPECT_NEAR(testing::texels_of(*s.textures[0])[11], 128.0 / 255.0, 1e-6);
     }},
    {"Ktx2TexturesWithoutASubstituteAreNoted",
     [](GltfModel& m) {
       m.json["extensionsUsed"] = {"KHR_texture_basisu"};
       m.json["textures"] = {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}};
       m.json["images"] = {{{"uri", "a.ktx2"}}};
       m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(0)}};
     },
     [](const SceneDescription& s) {
       EXPECT_THAT(s.textures, IsEmpty());
       EXPECT_THAT(s.notes, Contains(HasSubstr("KTX2 is not read")));
     }},
    {"AMissingPictureIsNoted",
     [](GltfModel& m) {
       m.json["images"] = {{{"uri", "https://example.com/a.png"}}};
       m.json["textures"] = {{{"source", 0}}};
       m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", texture_info(0)}};
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).base_colour_texture.texture, -1);
       EXPECT_THAT(s.notes, Contains(HasSubstr("images[0].uri: only files and data URIs")));
     }},
    {"EmissiveStrength",
     [](GltfModel& m) {
       m.material()["emissiveFactor"] = {1, 0.5, 0};
       set_extension(m, "KHR_materials_emissive_strength", {{"emissiveStrength", 4}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).emission, (Vec3{4, 2, 0}));
     }},
    {"Ior",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_ior", {{"ior", 1.75}});
     },
     [](const SceneDescription& s) { EXPECT_EQ(pbr_of(s).ior, 1.75); }},
    {"Unlit", [](GltfModel& m) { set_extension(m, "KHR_materials_unlit", json::object()); },
     [](const SceneDescription& s) { EXPECT_TRUE(pbr_of(s).unlit); }},
    {"Clearcoat",
     [](GltfModel& m) {
       const int texture = m.add_texture();
       set_extension(m, "KHR_materials_clearcoat",
                     {{"clearcoatFactor", 0.5},
                      {"clearcoatRoughnessFactor", 0.25},
                      {"clearcoatTexture", texture_info(texture)},
                      {"clearcoatNormalTexture", texture_info(texture)}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).clearcoat, 0.5);
       EXPECT_EQ(pbr_of(s).clearcoat_roughness, 0.25);
       EXPECT_EQ(pbr_of(s).clearcoat_texture.texture, 0);
       EXPECT_THAT(only_mesh(s).tangents, SizeIs(4));
     }},
    {"Sheen",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_sheen",
                     {{"sheenColorFactor", {0.5, 0.25, 0.125}}, {"sheenRoughnessFactor", 0.75}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).sheen_colour, (Vec3{0.5, 0.25, 0.125}));
       EXPECT_EQ(pbr_of(s).sheen_roughness, 0.75);
     }},
    {"Specular",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_specular",
                     {{"specularFactor", 0.5}, {"specularColorFactor", {2, 1, 0}}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).specular, 0.5);
       EXPECT_EQ(pbr_of(s).specular_colour, (Vec3{2, 1, 0}));
     }},
    {"TransmissionAndVolume",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_transmission", {{"transmissionFactor", 0.875}});
       set_extension(m, "KHR_materials_volume",
                     {{"thicknessFactor", 0.5},
                      {"attenuationDistance", 3},
                      {"attenuationColor", {0.5, 1, 1}}});
       m.node()["scale"] = {2, 2, 2};
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).transmission, 0.875);
       EXPECT_NEAR(pbr_of(s).thickness, 1.0, 1e-9) << "in the world, the node magnifies it";
       EXPECT_EQ(pbr_of(s).attenuation_distance, 3.0);
       EXPECT_EQ(pbr_of(s).attenuation_colour, (Vec3{0.5, 1, 1}));
     }},
    {"Iridescence",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_iridescence",
                     {{"iridescenceFactor", 0.5},
                      {"iridescenceIor", 1.5},
                      {"iridescenceThicknessMinimum", 50},
                      {"iridescenceThicknessMaximum", 500}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).iridescence, 0.5);
       EXPECT_EQ(pbr_of(s).iridescence_ior, 1.5);
       EXPECT_EQ(pbr_of(s).iridescence_thickness_min, 50.0);
       EXPECT_EQ(pbr_of(s).iridescence_thickness_max, 500.0);
     }},
    {"AnisotropyNeedsTangents",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_anisotropy",
                     {{"anisotropyStrength", 0.5}, {"anisotropyRotation", 1}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).anisotropy, 0.5);
       EXPECT_EQ(pbr_of(s).anisotropy_rotation, 1.0);
       EXPECT_THAT(only_mesh(s).tangents, SizeIs(4));
     }},
    {"SpecularGlossiness",
     [](GltfModel& m) {
       set_extension(m, "KHR_materials_pbrSpecularGlossiness",
                     {{"diffuseFactor", {0.5, 0.25, 0, 1}},
                      {"glossinessFactor", 0.75},
                      {"specularFactor", {0.04, 0.04, 0.04}}});
     },
     [](const SceneDescription& s) {
       EXPECT_EQ(pbr_of(s).base_colour, (Vec3{0.5, 0.25, 0}));
       EXPECT_EQ(pbr_of(s).metallic, 0.0);
       EXPECT_EQ(pbr_of(s).roughness, 0.25);
       EXPECT_NEAR(pbr_of(s).ior, 1.5, 1e-9);
     }},
    {"UnknownExtensionsAreNotedOnce",
     [](GltfModel& m) {
       m.json["extensionsUsed"] = {"EXT_one", "VENDOR_two"};
     },
     [](const SceneDescription& s) {
       expect_quad(s);
       EXPECT_THAT(s.notes, ElementsAre("extensions ignored: EXT_one, VENDOR_two"));
     }},
};

class GltfFeature : public ::testing::TestWithParam<Feature> {};

TEST_P(GltfFeature, IsReadFromTextAndBinary) {
  GltfModel model;
  GetParam().change(model);
  GetParam().expect(parse_gltf(model.gltf(), "model.gltf", std::nullopt));
  GetParam().expect(parse_gltf(model.glb(), "model.glb", std::nullopt));
}

std::string name_of(const ::testing::TestParamInfo<Feature>& info) {
  return info.param.name;
}

INSTANTIATE_TEST_SUITE_P(Geometry, GltfFeature, ::testing::ValuesIn(kGeometry), name_of);
INSTANTIATE_TEST_SUITE_P(Nodes, GltfFeature, ::testing::ValuesIn(kNodes), name_of);
INSTANTIATE_TEST_SUITE_P(Motion, GltfFeature, ::testing::ValuesIn(kMotion), name_of);
INSTANTIATE_TEST_SUITE_P(Materials, GltfFeature, ::testing::ValuesIn(kMaterials), name_of);

}  // namespace
}  // namespace lenticule::render
