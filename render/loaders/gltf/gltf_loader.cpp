// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/gltf_loader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/animation.h"
#include "render/loaders/exposure.h"
#include "render/loaders/gltf/animations.h"
#include "render/loaders/gltf/document.h"
#include "render/loaders/gltf/materials.h"
#include "render/loaders/gltf/nodes.h"
#include "render/loaders/limits.h"
#include "render/scene/nothing_seen.h"

namespace lenticule::render {
namespace {

using gltf::Document;
using gltf::JsonAt;

constexpr std::array<std::string_view, 18> kExtensions{"EXT_mesh_gpu_instancing",
                                                       "EXT_meshopt_compression",
                                                       "EXT_texture_webp",
                                                       "KHR_draco_mesh_compression",
                                                       "KHR_lights_punctual",
                                                       "KHR_materials_anisotropy",
                                                       "KHR_materials_clearcoat",
                                                       "KHR_materials_emissive_strength",
                                                       "KHR_materials_ior",
                                                       "KHR_materials_iridescence",
                                                       "KHR_materials_pbrSpecularGlossiness",
                                                       "KHR_materials_sheen",
                                                       "KHR_materials_specular",
                                                       "KHR_materials_transmission",
                                                       "KHR_materials_unlit",
                                                       "KHR_materials_volume",
                                                       "KHR_mesh_quantization",
                                                       "KHR_texture_transform"};

/// Metadata; leaving it out changes nothing.
constexpr std::array<std::string_view, 2> kWithoutEffect{"KHR_xmp_json_ld", "KHR_xmp"};

void check_version(const JsonAt& root) {
  const JsonAt version = root.at("asset").at("version");
  const std::string text = version.text();
  if (!text.starts_with("2.")) version.fail(fmt::format("glTF {}, expected 2", text.substr(0, 16)));
}

void check_extensions(const JsonAt& root, SceneDescription& scene) {
  for (const JsonAt& name : root.list("extensionsRequired")) {
    if (name.text() == "KHR_texture_basisu")
      throw Error(ErrorKind::Input,
                  fmt::format("{}: {}: KHR_texture_basisu: KTX2 textures are not read",
                              scene.source, name.path()),
                  "convert the model: gltf-transform ktxdecompress IN.glb OUT.glb");
    if (std::ranges::find(kExtensions, name.text()) == kExtensions.end())
      name.fail(fmt::format("unknown extension '{}'", name.text().substr(0, 80)));
  }
  std::string unknown;
  for (const JsonAt& name : root.list("extensionsUsed"))
    if (std::ranges::find(kExtensions, name.text()) == kExtensions.end() &&
        std::ranges::find(kWithoutEffect, name.text()) == kWithoutEffect.end())
      unknown += (unknown.empty() ? "" : ", ") + name.text().substr(0, 80);
  if (!unknown.empty()) scene.notes.push_back("extensions ignored: " + unknown);
}

}  // namespace

SceneDescription parse_gltf(std::vector<uint8_t> bytes, const std::string& source,
                            const std::optional<std::filesystem::path>& folder) {
  SceneDescription scene;
  scene.source = source;
  scene.colour_managed = true;
  try {
    Document document(std::move(bytes), source, folder);
    check_version(document.root());
    check_extensions(document.root(), scene);
    gltf::Notes notes;
    gltf::Materials materials(document, scene, notes);
    gltf::Nodes nodes(document, scene, notes);
    nodes.import_skins();
    nodes.import_meshes(materials);
    if (scene.meshes.empty()) {
      notes.write(scene);
      refuse_empty(scene);
    }
    gltf::import_animation(document, nodes, scene, notes);
    nodes.import_lights();
    nodes.import_cameras();
    notes.write(scene);
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::Input, source + ": needs more memory than is available");
  }
  expose(scene);
  bake_still_nodes(scene);
  return scene;
}

SceneDescription load_gltf(const std::filesystem::path& file) {
  return parse_gltf(read_whole_file(file, kMaxSceneFileBytes), file.string(), file.parent_path());
}

}  // namespace lenticule::render
