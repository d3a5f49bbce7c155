// SPDX-License-Identifier: Apache-2.0
// The readers of the formats, of which load_scene() chooses one; nff.h has that of NFF. Each throws
// Error(Input) that begins with the source, and the place in the file where there is one. A file
// beyond a limit is rejected too, instead of filling the memory or exceeding single precision.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/loaders/viewer_choices.h"
#include "render/scene/scene_description.h"

namespace lenticule::render {

inline constexpr uintmax_t kMaxSceneFileBytes = uintmax_t{1} << 30;
/// Buffers of a glTF scene from other files and data URIs, and decompressed, in total.
inline constexpr size_t kMaxBufferBytes = size_t{1} << 32;
inline constexpr size_t kMaxJsonValues = size_t{1} << 24;
/// Squares of coordinates must be representable in single precision.
inline constexpr double kMaxCoordinate = 1e15;
inline constexpr size_t kMaxVertices = size_t{1} << 26;
inline constexpr size_t kMaxTriangles = size_t{1} << 26;
inline constexpr size_t kMaxLights = 1024;
inline constexpr size_t kMaxNodes = size_t{1} << 20;
inline constexpr size_t kMaxMaterials = size_t{1} << 16;
inline constexpr size_t kMaxKeys = size_t{1} << 24;
/// Total of all textures, at 4 bytes per texel of 8-bit pictures and 16 of others.
inline constexpr size_t kMaxTextureBytes = size_t{1} << 31;
/// A scene that another process read.
inline constexpr uint64_t kMaxArchiveBytes = uint64_t{1} << 35;
/// Ear clipping takes time quadratic in the number of concave corners in the worst case.
inline constexpr int kMaxPolygonVertices = 10000;

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
