// SPDX-License-Identifier: Apache-2.0
// Converts assimp's scene to a SceneDescription.
#pragma once

#include <assimp/scene.h>

#include <filesystem>
#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Throws Error(Input) with the mesh and the vertex or face that is invalid.
void check_meshes(const aiScene& from, const std::string& source);

/// Converts the scene of a file. `origin` is the point of the file that assimp's origin stands for.
[[nodiscard]] SceneDescription import_scene(const aiScene& from, const std::filesystem::path& file,
                                            Vec3 origin);

}  // namespace lenticule::render
