// SPDX-License-Identifier: Apache-2.0
// Loads the formats that assimp reads.
#pragma once

#include <filesystem>
#include <string>

#include "render/loaders/viewer_choices.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Returns true if assimp has a reader for this extension (".stl").
[[nodiscard]] bool assimp_reads(const std::string& extension);

/// Loads a scene as load_scene() does.
[[nodiscard]] SceneDescription load_with_assimp(const std::filesystem::path& file,
                                                const ViewerChoices& wanted);

}  // namespace lenticule::render
