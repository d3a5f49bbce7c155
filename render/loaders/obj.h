// SPDX-License-Identifier: Apache-2.0
// Loads OBJ, with the materials of MTL files: polygons, texture coordinates, normals and vertex
// colours. docs/render/models.md has a table of the words.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Loads a scene as load_scene() does.
[[nodiscard]] SceneDescription load_obj(const std::filesystem::path& file);

/// Parses the bytes of `file`, in whose folder the MTL files lie. Throws Error(Input) "file:line:
/// reason"; what is wrong in an MTL file becomes a note.
[[nodiscard]] SceneDescription parse_obj(std::span<const uint8_t> bytes,
                                         const std::filesystem::path& file);

}  // namespace lenticule::render
