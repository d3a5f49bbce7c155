// SPDX-License-Identifier: Apache-2.0
// Writes glTF models, one per feature of materials, textures or geometry, into a folder. Another
// renderer draws them, too (scripts/test-judge).
// Usage: judge_models FOLDER
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "base/file.h"
#include "tests/support/gltf_model.h"

namespace {

using lenticule::test::ByteVector;
using lenticule::test::GltfModel;
using nlohmann::json;

/// Mesh holds the arrays of a sphere of radius 1 around the origin.
struct Mesh {
  std::vector<float> positions, normals, uvs, colours;
  std::vector<uint16_t> corners;
};

Mesh sphere() {
  constexpr int kAround = 48, kDown = 24;
  Mesh mesh;
  for (int j = 0; j <= kDown; ++j)
    for (int i = 0; i <= kAround; ++i) {
      const double u = static_cast<double>(i) / kAround, v = static_cast<double>(j) / kDown;
      const double around = 2.0 * std::numbers::pi * u, down = std::numbers::pi * v;
      const double point[] = {std::sin(down) * std::sin(around), std::cos(down),
                              std::sin(down) * std::cos(around)};
      for (const double x : point) {
        mesh.positions.push_back(static_cast<float>(x));
        mesh.normals.push_back(static_cast<float>(x));
        mesh.colours.push_back(static_cast<float>(0.5 + 0.5 * x));
      }
      mesh.uvs.push_back(static_cast<float>(u));
      mesh.uvs.push_back(static_cast<float>(v));
    }
  const auto vertex = [](int i, int j) { return static_cast<uint16_t>(j * (kAround + 1) + i); };
  for (int j = 0; j < kDown; ++j)
    for (int i = 0; i < kAround; ++i) {
      // One triangle at the poles, two elsewhere.
      if (j > 0)
        for (const uint16_t n : {vertex(i, j), vertex(i, j + 1), vertex(i + 1, j)})
          mesh.corners.push_back(n);
      if (j + 1 < kDown)
        for (const uint16_t n : {vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)})
          mesh.corners.push_back(n);
    }
  return mesh;
}

/// Returns a model of a sphere with a grey material.
GltfModel sphere_model() {
  GltfModel model;
  const Mesh mesh = sphere();
  using enum lenticule::test::ComponentCode;
  model.attributes()["POSITION"] = model.add_accessor(mesh.positions, "VEC3", kFloat,
                                                      {{"min", {-1, -1, -1}}, {"max", {1, 1, 1}}});
  model.attributes()["NORMAL"] = model.add_accessor(mesh.normals, "VEC3", kFloat);
  model.attributes()["TEXCOORD_0"] = model.add_accessor(mesh.uvs, "VEC2", kFloat);
  model.primitive()["indices"] = model.add_accessor(mesh.corners, "SCALAR", kUshort);
  model.material()["pbrMetallicRoughness"] = {
      {"baseColorFactor", {0.6, 0.6, 0.6, 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.5}};
  return model;
}

json& core(GltfModel& model) { return model.material()["pbrMetallicRoughness"]; }

void extend(GltfModel& model, const std::string& extension, const json& properties) {
  model.json["extensionsUsed"].push_back(extension);
  model.material()["extensions"][extension] = properties;
}

struct Feature {
  const char* name;
  std::function<void(GltfModel&)> change;
};

/// Adds a texture whose texels are visible, so that both renderers filter them.
json texture(GltfModel& model) {
  return {{"index", model.add_texture({{"wrapS", 10497}, {"wrapT", 10497}})}};
}

std::vector<Feature> features() {
  using enum lenticule::test::ComponentCode;
  const auto surface = [](double metallic, double roughness) {
    return [=](GltfModel& m) {
      core(m)["metallicFactor"] = metallic;
      core(m)["roughnessFactor"] = roughness;
      core(m)["baseColorFactor"] = {0.9, 0.6, 0.3, 1.0};
    };
  };
  return {
      {"matt", surface(0.0, 1.0)},
      {"glossy", surface(0.0, 0.15)},
      {"metal-polished", surface(1.0, 0.1)},
      {"metal-rough", surface(1.0, 0.6)},
      {"half-metal", surface(0.5, 0.4)},
      {"base-texture", [](GltfModel& m) { core(m)["baseColorTexture"] = texture(m); }},
      {"metallic-roughness-texture",
       [](GltfModel& m) {
         core(m)["metallicFactor"] = 1.0;
         core(m)["roughnessFactor"] = 1.0;
         core(m)["metallicRoughnessTexture"] = texture(m);
       }},
      {"occlusion", [](GltfModel& m) { m.material()["occlusionTexture"] = texture(m); }},
      {"emission",
       [](GltfModel& m) {
         m.material()["emissiveFactor"] = {0.8, 0.4, 0.1};
         m.material()["emissiveTexture"] = texture(m);
       }},
      {"texture-transform",
       [](GltfModel& m) {
         m.json["extensionsUsed"] = {"KHR_texture_transform"};
         json used = texture(m);
         used["extensions"]["KHR_texture_transform"] = {
             {"scale", {3.0, 2.0}}, {"rotation", 0.4}, {"offset", {0.1, 0.2}}};
         core(m)["baseColorTexture"] = used;
       }},
      {"vertex-colours",
       [](GltfModel& m) {
         m.attributes()["COLOR_0"] = m.add_accessor(sphere().colours, "VEC3", kFloat);
       }},
      {"mask",
       [](GltfModel& m) {
         core(m)["baseColorTexture"] = texture(m);
         m.material()["alphaMode"] = "MASK";
         m.material()["alphaCutoff"] = 0.7;
         m.material()["doubleSided"] = true;
       }},
      {"blend",
       [](GltfModel& m) {
         core(m)["baseColorFactor"] = {0.2, 0.5, 0.9, 0.6};
         m.material()["alphaMode"] = "BLEND";
       }},
      {"unlit", [](GltfModel& m) { extend(m, "KHR_materials_unlit", json::object()); }},
      {"clearcoat",
       [](GltfModel& m) {
         core(m)["baseColorFactor"] = {0.7, 0.1, 0.1, 1.0};
         extend(m, "KHR_materials_clearcoat",
                {{"clearcoatFactor", 1.0}, {"clearcoatRoughnessFactor", 0.1}});
       }},
      {"sheen",
       [](GltfModel& m) {
         extend(m, "KHR_materials_sheen",
                {{"sheenColorFactor", {0.5, 0.5, 0.9}}, {"sheenRoughnessFactor", 0.5}});
       }},
      {"specular",
       [](GltfModel& m) {
         core(m)["roughnessFactor"] = 0.2;
         extend(m, "KHR_materials_specular",
                {{"specularFactor", 0.8}, {"specularColorFactor", {1.0, 0.5, 0.2}}});
       }},
      {"ior",
       [](GltfModel& m) {
         core(m)["roughnessFactor"] = 0.2;
         extend(m, "KHR_materials_ior", {{"ior", 2.2}});
       }},
      {"iridescence",
       [](GltfModel& m) {
         core(m)["metallicFactor"] = 1.0;
         core(m)["roughnessFactor"] = 0.3;
         extend(m, "KHR_materials_iridescence",
                {{"iridescenceFactor", 1.0}, {"iridescenceThicknessMaximum", 400.0}});
       }},
      {"mirrored-nodes",
       [](GltfModel& m) {
         core(m)["baseColorTexture"] = texture(m);
         m.add_node({{"mesh", 0}, {"translation", {2.2, 0.0, 0.0}}, {"scale", {-1.0, 0.7, 1.0}}});
       }},
      {"morph",
       [](GltfModel& m) {
         std::vector<float> offsets = sphere().positions;
         for (size_t n = 0; n < offsets.size(); ++n)
           offsets[n] = n % 3 == 1 ? 0.5F * offsets[n] : -0.3F * offsets[n];
         m.primitive()["targets"] = {{{"POSITION", m.add_accessor(offsets, "VEC3", kFloat)}}};
         m.json["meshes"][0]["weights"] = {0.8};
       }},
      {"quantized",
       [](GltfModel& m) {
         std::vector<int16_t> shorts;
         const Mesh mesh = sphere();
         for (size_t n = 0; n < mesh.positions.size(); ++n) {
           shorts.push_back(static_cast<int16_t>(std::lround(32767.0F * mesh.positions[n])));
           if (n % 3 == 2) shorts.push_back(0);  // vertices begin at multiples of four bytes
         }
         const int view = m.add_view(lenticule::test::bytes_of(shorts), 8);
         m.attributes()["POSITION"] =
             m.add_accessor_at(view, mesh.positions.size() / 3, "VEC3", kShort,
                               {{"normalized", true},
                                {"min", {-32767, -32767, -32767}},
                                {"max", {32767, 32767, 32767}}});
         m.require("KHR_mesh_quantization");
       }},
  };
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: judge_models FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  for (const Feature& feature : features()) {
    GltfModel model = sphere_model();
    feature.change(model);
    const ByteVector glb = model.glb();
    lenticule::write_file_atomically(folder / fmt::format("{}.glb", feature.name), glb);
  }
  return 0;
}
