// SPDX-License-Identifier: Apache-2.0
// glTF 2.0, OBJ, PLY, STL and the rest of what assimp reads.
#pragma once

#include <filesystem>
#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Whether assimp has a reader for this extension (".obj").
[[nodiscard]] bool assimp_reads(const std::string& extension);

/// As load_scene.
[[nodiscard]] SceneDescription load_with_assimp(const std::filesystem::path& file);

}  // namespace lenticule::render
