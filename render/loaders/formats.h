// SPDX-License-Identifier: Apache-2.0
// The readers of the formats, of which load_scene() chooses one; nff.h has that of NFF. Each throws
// Error(Input) that begins with the source, and the place in the file where there is one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/loaders/viewer_choices.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

/// Parses glTF 2.0, .gltf or .glb. Without the folder to which its URIs are relative, other files
/// are not read. Errors name the path of the JSON value.
[[nodiscard]] SceneDescription parse_gltf(std::vector<uint8_t> bytes, const std::string& source,
                                          const std::optional<std::filesystem::path>& folder,
                                          const ViewerChoices& wanted = {});

/// Parses OBJ: polygons, texture coordinates, normals and vertex colours, with the materials of MTL
/// files in the folder of `file` (docs/render/models.md has a table of the words). What is wrong in
/// an MTL file becomes a note.
[[nodiscard]] SceneDescription parse_obj(std::span<const uint8_t> bytes,
                                         const std::filesystem::path& file);

/// Parses PLY: polygons and triangle strips, in text or binary, with vertex colours. Textures lie
/// in `folder`.
[[nodiscard]] SceneDescription parse_ply(std::span<const uint8_t> bytes, const std::string& source,
                                         const std::filesystem::path& folder);

/// Parses STL: triangles, in text or binary, with the colours that programs store in binary files.
[[nodiscard]] SceneDescription parse_stl(std::span<const uint8_t> bytes, const std::string& source);

/// Returns true if assimp has a reader for this extension (".stl").
[[nodiscard]] bool assimp_reads(const std::string& extension);
[[nodiscard]] SceneDescription load_with_assimp(const std::filesystem::path& file,
                                                const ViewerChoices& wanted);

}  // namespace lenticule::render
