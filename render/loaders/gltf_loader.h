// SPDX-License-Identifier: Apache-2.0
// Loads glTF 2.0.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "render/loaders/viewer_choices.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Loads a scene as load_scene() does.
[[nodiscard]] SceneDescription load_gltf(const std::filesystem::path& file,
                                         const ViewerChoices& wanted);

/// Reads the bytes of a .gltf or .glb file. Without the folder to which its URIs are relative,
/// other files are not read. Throws Error(Input) "source: path of the JSON value: reason".
[[nodiscard]] SceneDescription parse_gltf(std::vector<uint8_t> bytes, const std::string& source,
                                          const std::optional<std::filesystem::path>& folder,
                                          const ViewerChoices& wanted = {});

}  // namespace lenticule::render
