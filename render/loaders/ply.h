// SPDX-License-Identifier: Apache-2.0
// Loads PLY: polygons and triangle strips, in text or binary, with vertex colours.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Loads a scene as load_scene() does.
[[nodiscard]] SceneDescription load_ply(const std::filesystem::path& file);

/// Parses a file whose textures lie in `folder`. Throws Error(Input) "source: reason", with the
/// element where there is one.
[[nodiscard]] SceneDescription parse_ply(std::span<const uint8_t> bytes, const std::string& source,
                                         const std::filesystem::path& folder);

}  // namespace lenticule::render
