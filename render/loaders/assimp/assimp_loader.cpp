// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/assimp_loader.h"

#include <assimp/postprocess.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <memory>

#include "base/error.h"
#include "base/file.h"
#include "render/loaders/animation.h"
#include "render/loaders/assimp/guarded_files.h"
#include "render/loaders/assimp/obj_centre.h"
#include "render/loaders/assimp/parts.h"
#include "render/loaders/exposure.h"
#include "render/loaders/limits.h"
#include "render/loaders/scene_extension.h"
#include "render/scene/nothing_seen.h"

namespace lenticule::render {
namespace {

/// Shortens assimp's messages, which are meant for programmers: first line only, printable, limited
/// length.
std::string tidy(const std::string& message) {
  constexpr size_t kLongest = 160;
  if (message.starts_with("No suitable reader"))
    return "not in the format of its extension, or damaged or truncated";
  std::string out;
  for (const char c : message.substr(0, std::min(message.find('\n'), kLongest)))
    out += c >= ' ' && c < 127 ? c : '?';
  while (out.ends_with('.')) out.pop_back();
  return out.empty() ? "cannot be parsed" : out;
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& reason) {
  throw Error(ErrorKind::Input, fmt::format("{}: {}", file.string(), reason));
}

/// Reads the file. The data is checked before assimp's own post-processing runs, which trusts the
/// data. The importer deletes `files`.
const aiScene& read(Assimp::Importer& importer, const std::filesystem::path& file,
                    std::unique_ptr<GuardedFiles> files) {
  importer.SetIOHandler(files.release());
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

/// `origin` is the point of the file that assimp's origin stands for.
SceneDescription convert(const aiScene& from, const std::filesystem::path& file, Vec3 origin) {
  SceneDescription scene;
  scene.source = file.string();
  scene.colour_managed = true;
  import_materials(from, file.parent_path(), scene);
  const NodeNames nodes = import_nodes_and_meshes(from, scene);
  if (scene.meshes.empty()) refuse_empty(scene);
  // An OBJ file has no transforms: its nodes' coordinates are the file's.
  if (!(origin == Vec3{}))
    for (TriangleMesh& mesh : scene.meshes)
      for (Vec3& p : mesh.positions) p += origin;
  import_animation(from, nodes, scene);
  import_lights(from, nodes, scene);
  import_cameras(from, nodes, scene);
  expose(scene);
  bake_still_nodes(scene);
  return scene;
}

}  // namespace

bool assimp_reads(const std::string& extension) {
  return !extension.empty() && Assimp::Importer().IsExtensionSupported(extension);
}

SceneDescription load_with_assimp(const std::filesystem::path& file) {
  try {
    Assimp::Importer importer;
    std::optional<CentredObj> centred;
    if (extension_of(file) == ".obj")
      centred = centre_obj(read_whole_file(file, kMaxSceneFileBytes));
    if (!centred) return convert(read(importer, file, std::make_unique<GuardedFiles>()), file, {});
    auto files = std::make_unique<GuardedFiles>(file.string(), std::move(centred->text));
    return convert(read(importer, file, std::move(files)), file, centred->centre);
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    refuse(file, "needs more memory than is available");
  } catch (const std::exception& failure) {
    refuse(file, tidy(failure.what()));
  }
}

}  // namespace lenticule::render
