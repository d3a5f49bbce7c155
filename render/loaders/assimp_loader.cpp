// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/assimp_loader.h"

#include <assimp/postprocess.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <memory>

#include "base/error.h"
#include "render/loaders/animation.h"
#include "render/loaders/assimp_parts.h"
#include "render/loaders/guarded_files.h"
#include "render/loaders/scene_extension.h"
#include "render/scene/nothing_seen.h"

namespace lenticule::render {
namespace {

/// Shortens assimp's messages, which are meant for programmers: first line only, printable, limited
/// length.
std::string tidy(const std::string& message) {
  constexpr size_t kLongest = 160;
  if (message.starts_with("No suitable reader"))
    return "not what its name says: damaged, truncated or another format";
  std::string out;
  for (const char c : message.substr(0, std::min(message.find('\n'), kLongest)))
    out += c >= ' ' && c < 127 ? c : '?';
  while (out.ends_with('.')) out.pop_back();
  return out.empty() ? "cannot be understood" : out;
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& reason) {
  throw Error(ErrorKind::Input, fmt::format("{}: {}", file.string(), reason));
}

/// Reads the file. The data is checked before assimp's own post-processing runs, which trusts the
/// data.
const aiScene& read(Assimp::Importer& importer, const std::filesystem::path& file) {
  importer.SetIOHandler(std::make_unique<GuardedFiles>().release());  // the importer deletes it
  importer.SetPropertyBool("IMPORT_NO_SKELETON_MESHES", true);
  const aiScene* scene = importer.ReadFile(file.string(), 0);
  if (scene == nullptr) refuse(file, tidy(importer.GetErrorString()));
  if (scene->mNumMeshes == 0) refuse_empty({.source = file.string()});
  check_meshes(*scene, file.string());
  // Not aiProcess_JoinIdenticalVertices, which merges vertices within 1e-5 units and so collapses a
  // small scene to a point.
  scene = importer.ApplyPostProcessing(aiProcess_Triangulate | aiProcess_SortByPType |
                                       aiProcess_FlipUVs);
  if (scene == nullptr) refuse(file, tidy(importer.GetErrorString()));
  check_meshes(*scene, file.string());
  return *scene;
}

SceneDescription convert(const aiScene& from, const std::filesystem::path& file) {
  SceneDescription scene;
  scene.source = file.string();
  scene.colour_managed = true;
  import_materials(from, file.parent_path(), scene);
  const NodeNames nodes = import_nodes_and_meshes(from, scene);
  if (scene.meshes.empty()) refuse_empty(scene);
  import_animation(from, nodes, scene);
  import_lights(from, nodes, scene);
  import_cameras(from, nodes, scene);
  expose(scene);
  bake_still_nodes(scene);
  return scene;
}

}  // namespace

bool is_gltf(const std::string& source) {
  const std::string extension = extension_of(source);
  return extension == ".gltf" || extension == ".glb";
}

bool assimp_reads(const std::string& extension) {
  return !extension.empty() && Assimp::Importer().IsExtensionSupported(extension);
}

SceneDescription load_with_assimp(const std::filesystem::path& file) {
  try {
    Assimp::Importer importer;
    return convert(read(importer, file), file);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    refuse(file, "asks for more memory than there is");
  } catch (const std::exception& failure) {
    refuse(file, tidy(failure.what()));
  }
}

}  // namespace lenticule::render
