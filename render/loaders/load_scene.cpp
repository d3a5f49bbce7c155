// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/load_scene.h"

#include <fmt/format.h>

#include "base/error.h"
#include "render/loaders/assimp_loader.h"
#include "render/loaders/nff.h"
#include "render/loaders/scene_extension.h"

namespace lenticule::render {

namespace {

SceneDescription load(const std::filesystem::path& file) {
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (!std::filesystem::exists(status))
    throw Error(ErrorKind::Input, fmt::format("{}: no such file", file.string()));
  if (!std::filesystem::is_regular_file(status))
    throw Error(ErrorKind::Input, fmt::format("{}: not a regular file", file.string()));
  const std::string extension = extension_of(file);
  if (extension == ".nff") return load_nff(file);
  if (assimp_reads(extension)) return load_with_assimp(file);
  throw Error(ErrorKind::Input,
              fmt::format("{}: unknown kind of scene '{}'", file.string(), extension),
              "known are .nff, .gltf, .glb, .obj, .ply, .stl and the other formats of assimp");
}

}  // namespace

SceneDescription load_scene(const std::filesystem::path& file, const LoadOptions& options) {
  SceneDescription scene = load(file);
  turn_upright(scene, options.up.value_or(UpAxis::Y));
  return scene;
}

}  // namespace lenticule::render
