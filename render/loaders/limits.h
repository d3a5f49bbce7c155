// SPDX-License-Identifier: Apache-2.0
// Limits for scene files. A file beyond a limit is rejected with a clear error, instead of filling
// the memory or exceeding the range of single precision.
#pragma once

#include <cstddef>
#include <cstdint>

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

}  // namespace lenticule::render
