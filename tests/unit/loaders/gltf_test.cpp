// SPDX-License-Identifier: Apache-2.0
// Tests the import of glTF with small generated models: one case of tests/data/gltf-features.json
// per feature. `model` is what a case changes of the quad of test::GltfModel, `shows` is a part of
// what the loader makes of it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>

#include "render/loaders/formats.h"
#include "tests/support/error_matchers.h"
#include "tests/support/gltf_model.h"
#include "tests/support/texels.h"

namespace lenticule::render {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using namespace lenticule::test;

// --- what the loader makes of it

json list(Vec3 v) { return {v.x, v.y, v.z}; }

json list(const std::vector<Vec3>& vectors) {
  json all = json::array();
  for (const Vec3 v : vectors) all.push_back(list(v));
  return all;
}

json described(const TextureUse& use) {
  return {{"number", use.texture}, {"uv set", use.uv_set}, {"uv map", use.uv_map}};
}

json described(const PbrMaterial& m) {
  constexpr const char* kAlphaModes[] = {"opaque", "mask", "blend"};
  return {{"base colour", list(m.base_colour)},
          {"alpha", m.alpha},
          {"base colour texture", described(m.base_colour_texture)},
          {"metallic", m.metallic},
          {"roughness", m.roughness},
          {"metallic roughness texture", described(m.metallic_roughness_texture)},
          {"normal texture", described(m.normal_texture)},
          {"normal scale", m.normal_scale},
          {"occlusion texture", described(m.occlusion_texture)},
          {"occlusion strength", m.occlusion_strength},
          {"emission", list(m.emission)},
          {"emission texture", described(m.emission_texture)},
          {"alpha mode", kAlphaModes[static_cast<size_t>(m.alpha_mode)]},
          {"alpha cutoff", m.alpha_cutoff},
          {"double sided", m.double_sided},
          {"unlit", m.unlit},
          {"ior", m.ior},
          {"specular", m.specular},
          {"specular colour", list(m.specular_colour)},
          {"clearcoat", m.clearcoat},
          {"clearcoat roughness", m.clearcoat_roughness},
          {"clearcoat texture", described(m.clearcoat_texture)},
          {"sheen colour", list(m.sheen_colour)},
          {"sheen roughness", m.sheen_roughness},
          {"transmission", m.transmission},
          {"thickness", m.thickness},
          {"attenuation distance", m.attenuation_distance},
          {"attenuation colour", list(m.attenuation_colour)},
          {"iridescence", m.iridescence},
          {"iridescence ior", m.iridescence_ior},
          {"iridescence thickness", {m.iridescence_thickness_min, m.iridescence_thickness_max}},
          {"anisotropy", m.anisotropy},
          {"anisotropy rotation", m.anisotropy_rotation}};
}

json described(const TriangleMesh& mesh) {
  return {{"positions", list(mesh.positions)}, {"triangles", mesh.triangles},
          {"normals", list(mesh.normals)},     {"uvs", mesh.uvs},
          {"second uvs", mesh.uvs2},           {"colours", mesh.colours},
          {"tangents", mesh.tangents},         {"tangent count", mesh.tangents.size()}};
}

json described(const Texture& texture) {
  return {
      {"repeat u", texture.repeat_u},  {"repeat v", texture.repeat_v},
      {"mirror u", texture.mirror_u},  {"mirror v", texture.mirror_v},
      {"colours", texels_of(texture)}, {"data", texels_of(texture, frames::TextureContent::Data)}};
}

json described(const Light& light, double scale) {
  constexpr const char* kKinds[] = {"point", "directional", "spot"};
  return {{"kind", kKinds[static_cast<size_t>(light.kind)]},
          {"position", list(light.position)},
          {"direction", list(light.direction)},
          {"colour of the file", list(light.colour / scale)},
          {"falls off", light.falls_off},
          {"cos inner", light.cos_inner},
          {"cos outer", light.cos_outer}};
}

json described(const Camera& camera) {
  return {{"name", camera.name},
          {"from", list(camera.from)},
          {"at", list(camera.at)},
          {"fov degrees", camera.vertical_fov_degrees},
          {"hither", camera.hither}};
}

/// Returns the area of all triangles that face +z.
double area_of(const SceneDescription& scene) {
  double sum = 0.0;
  for (const TriangleMesh& mesh : scene.meshes)
    for (const auto& [a, b, c] : mesh.triangles)
      sum += cross(mesh.positions[b] - mesh.positions[a], mesh.positions[c] - mesh.positions[a]).z;
  return sum / 2.0;
}

/// Returns true for the quad as the model's constructor makes it.
bool is_quad(const TriangleMesh& mesh) {
  const std::vector<Vec3> corners{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  return mesh.triangles == decltype(mesh.triangles){{0, 1, 2}, {0, 2, 3}} &&
         std::ranges::equal(mesh.positions, corners,
                            [](Vec3 a, Vec3 b) { return length(a - b) < 1e-6; });
}

/// Gives every mesh vertices of its own.
SceneDescription with_vertices(SceneDescription scene) {
  std::vector<TriangleMesh> meshes;
  for_each_mesh(scene, [&](const TriangleMesh& mesh) { meshes.push_back(mesh); });
  scene.meshes = std::move(meshes);
  return scene;
}

json described(const SceneDescription& shared) {
  const SceneDescription scene = with_vertices(shared);
  const TriangleMesh& mesh = scene.meshes.at(0);
  const Material& material = scene.materials.at(static_cast<size_t>(mesh.material));
  json all = described(mesh);  // a model of one mesh needs no numbers of meshes
  std::string notes;
  for (const std::string& note : scene.notes) notes += note + "\n";
  all.update({{"quad", scene.meshes.size() == 1 && is_quad(mesh)},
              {"area", area_of(scene)},
              {"mesh count", scene.meshes.size()},
              {"texture count", scene.textures.size()},
              {"moving nodes", scene.nodes.size()},
              {"duration", scene.duration_seconds},
              {"exposed", scene.light_scale < 0.65},
              {"notes", notes},
              {"note count", scene.notes.size()},
              {"pbr", described(*material.pbr)}});
  for (const char* key : {"meshes", "textures", "cameras", "lights"}) all[key] = json::array();
  for (const TriangleMesh& each : scene.meshes) all["meshes"].push_back(described(each));
  for (const auto& each : scene.textures) all["textures"].push_back(described(*each));
  for (const Camera& each : scene.cameras) all["cameras"].push_back(described(each));
  for (const Light& each : scene.lights)
    all["lights"].push_back(described(each, scene.light_scale));
  return all;
}

/// Expects a part of a description: numbers up to rounding, and a part of each text. Keys of lists
/// are indices.
void expect_part(const json& found, const json& wanted, const std::string& where) {
  SCOPED_TRACE(where);
  if (wanted.is_object()) {
    for (const auto& [key, part] : wanted.items())
      expect_part(found.is_array() ? found.at(std::stoul(key)) : found.at(key), part,
                  where + "/" + key);
  } else if (wanted.is_array()) {
    ASSERT_EQ(found.size(), wanted.size()) << found;
    for (size_t n = 0; n < wanted.size(); ++n)
      expect_part(found[n], wanted[n], where + "/" + std::to_string(n));
  } else if (wanted.is_number()) {
    EXPECT_NEAR(found.get<double>(), wanted.get<double>(), 1e-5);
  } else if (wanted.is_string()) {
    EXPECT_THAT(found.get<std::string>(), HasSubstr(wanted.get<std::string>()));
  } else {
    EXPECT_EQ(found, wanted);
  }
}

void expect_scene(const SceneDescription& scene, json wanted) {
  if (wanted.contains("at"))
    for (const auto& [seconds, part] : wanted["at"].items())
      expect_part(described(at_time(scene, std::stod(seconds))), part, seconds + " s");
  wanted.erase("at");
  expect_part(described(scene), wanted, "");
}

class GltfFeature : public ::testing::TestWithParam<nlohmann::ordered_json> {};

TEST_P(GltfFeature, IsReadFromTextAndBinary) {
  const GltfModel model(GetParam()["model"]);
  const json shows = json::parse(GetParam()["shows"].dump());
  const json of = json::parse(GetParam().value("choices", nlohmann::ordered_json::object()).dump());
  const ViewerChoices choices{.scene = of.value("scene", ""),
                              .animation = of.value("animation", ""),
                              .variant = of.value("variant", "")};
  expect_scene(parse_gltf(model.gltf(), "model.gltf", std::nullopt, choices), shows);
  expect_scene(parse_gltf(model.glb(), "model.glb", std::nullopt, choices), shows);
}

INSTANTIATE_TEST_SUITE_P(
    File, GltfFeature,
    ::testing::ValuesIn(gltf_cases(LENTICULE_SOURCE_DIR "/tests/data/gltf-features.json")),
    [](const auto& info) { return info.param["name"].template get<std::string>(); });

TEST(Gltf, NodesThatShowOneMeshShareItsVertices) {
  GltfModel m;
  for (int n = 1; n < 100; ++n) m.add_node({{"mesh", 0}, {"translation", {n, 0, 0}}});
  const SceneDescription scene = parse_gltf(m.glb(), "model.glb", std::nullopt);
  ASSERT_THAT(scene.meshes, SizeIs(100));
  ASSERT_THAT(scene.shapes, SizeIs(1));
  EXPECT_TRUE(scene.nodes.empty());
  for (const TriangleMesh& mesh : scene.meshes) EXPECT_TRUE(mesh.positions.empty());
  EXPECT_EQ(scene.meshes[99].place.origin, (Vec3{99, 0, 0}));
  EXPECT_NEAR(area_of(with_vertices(scene)), 100.0, 1e-6);
}

TEST(Gltf, NamesWhatThereIsForAnUnknownChoice) {
  GltfModel m;
  m.json["extensions"]["KHR_materials_variants"]["variants"] = {{{"name", "day"}},
                                                                {{"name", "night"}}};
  m.animate(0, "translation", {0, 1}, {0, 0, 0, 1, 0, 0}, "VEC3");
  const auto message_for = [&](const ViewerChoices& choices) {
    const Error error =
        error_of([&] { (void)parse_gltf(m.glb(), "model.glb", std::nullopt, choices); });
    return std::string(error.what()) + "; " + error.hint();
  };
  EXPECT_EQ(message_for({.variant = "dusk"}),
            "model.glb: no variant 'dusk'; the file has 1 'day', 2 'night'");
  EXPECT_EQ(message_for({.animation = "2"}), "model.glb: no animation '2'; the file has 1");
  EXPECT_EQ(message_for({.scene = "0"}), "model.glb: no scene '0'; the file has 1");
}

TEST(ApplyChoices, RefusesWhatTheFormatDoesNotHave) {
  SceneDescription scene{.source = "ball.nff", .cameras = {{.name = "front"}, {.name = "side"}}};
  EXPECT_THAT(error_of([&] { apply_choices(scene, {.variant = "1"}); }).hint(),
              HasSubstr("the file has no variants"));
  EXPECT_THAT(error_of([&] { apply_choices(scene, {.camera = "top"}); }).hint(),
              HasSubstr("1 'front', 2 'side'"));
  scene.animations.names = {"walk", "run"};
  apply_choices(scene, {.animation = "none", .camera = "side"});
  EXPECT_THAT(scene.notes, SizeIs(0));
  EXPECT_EQ(scene.camera, 1);
  apply_choices(scene, {});
  EXPECT_THAT(scene.notes, ElementsAre("2 animations, the first is played"));
}

// --- compressed meshes and pictures

TEST(Gltf, ReadsDracoMeshes) {
  GltfModel m;
  m.require("KHR_draco_mesh_compression");
  m.primitive()["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", m.add_view(draco_quad())},
      {"attributes", {{"POSITION", 0}, {"NORMAL", 1}, {"TEXCOORD_0", 2}}}};
  for (size_t i = 0; i < 4; ++i) m.json["accessors"][i].erase("bufferView");
  const SceneDescription scene = parse_gltf(m.glb(), "model.glb", std::nullopt);
  EXPECT_NEAR(area_of(scene), 1.0, 1e-5);
  const TriangleMesh& mesh = scene.meshes.at(0);
  ASSERT_THAT(mesh.positions, SizeIs(4));
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(mesh.uvs[i][0], mesh.positions[i].x, 1e-3);
    EXPECT_NEAR(mesh.uvs[i][1], 1.0 - mesh.positions[i].y, 1e-3);
  }
}

TEST(Gltf, ReadsMeshoptBuffersWhoseFallbackHasNoBytes) {
  GltfModel m;
  m.require("EXT_meshopt_compression");
  const auto compress = [&](size_t accessor, const ByteVector& data, int count, int stride,
                            const char* mode) {
    json compressed = m.json["bufferViews"][static_cast<size_t>(m.add_view(data))];
    compressed.update({{"count", count}, {"byteStride", stride}, {"mode", mode}});
    m.json["bufferViews"].push_back({{"buffer", 1},
                                     {"byteLength", count * stride},
                                     {"extensions", {{"EXT_meshopt_compression", compressed}}}});
    m.json["accessors"][accessor]["bufferView"] = m.json["bufferViews"].size() - 1;
  };
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  compress(0, meshopt_vertices(bytes_of(positions), 12), 4, 12, "ATTRIBUTES");
  compress(3, meshopt_triangles({0, 1, 2, 0, 2, 3}, 4), 6, 2, "TRIANGLES");
  m.json["buffers"] = {
      {{"byteLength", 1000}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  EXPECT_NEAR(area_of(parse_gltf(m.glb(), "model.glb", std::nullopt)), 1.0, 1e-5);
}

TEST(Gltf, ReadsWebpTextures) {
  GltfModel m;
  m.require("EXT_texture_webp");
  m.json["images"] = {{{"bufferView", m.add_view(small_webp())}, {"mimeType", "image/webp"}}};
  m.json["textures"] = {{{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}}};
  m.material()["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}}};
  const SceneDescription scene = parse_gltf(m.glb(), "model.glb", std::nullopt);
  ASSERT_THAT(scene.textures, SizeIs(1)) << ::testing::PrintToString(scene.notes);
  EXPECT_EQ(scene.textures[0]->width, 2);
  EXPECT_NEAR(texels_of(*scene.textures[0])[11], 128.0 / 255.0, 1e-6);
}

}  // namespace
}  // namespace lenticule::render
