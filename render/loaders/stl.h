// SPDX-License-Identifier: Apache-2.0
// Loads STL: triangles, in text or binary, with the colours that programs store in binary files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Loads a scene as load_scene() does.
[[nodiscard]] SceneDescription load_stl(const std::filesystem::path& file);

/// Throws Error(Input) "source:line: reason" for a text, "source: byte: reason" for a binary file.
[[nodiscard]] SceneDescription parse_stl(std::span<const uint8_t> bytes, const std::string& source);

}  // namespace lenticule::render
