// SPDX-License-Identifier: Apache-2.0
// How much of a scene file is believed. Beyond these a file is refused with a clear error instead
// of being allowed to fill the memory or the single-precision range of the tracer.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lenticule::render {

inline constexpr uintmax_t kMaxSceneFileBytes = uintmax_t{1} << 30;
/// Squares of coordinates must stay inside single precision.
inline constexpr double kMaxCoordinate = 1e15;
inline constexpr size_t kMaxVertices = size_t{1} << 26;
inline constexpr size_t kMaxTriangles = size_t{1} << 26;
inline constexpr size_t kMaxLights = 1024;
inline constexpr size_t kMaxNodes = size_t{1} << 20;
inline constexpr size_t kMaxMaterials = size_t{1} << 16;
inline constexpr size_t kMaxKeys = size_t{1} << 24;
/// Of all textures together, at 16 bytes each.
inline constexpr size_t kMaxTexels = size_t{1} << 27;
/// Ear clipping costs the square of the concave corners in the worst case.
inline constexpr int kMaxPolygonVertices = 10000;

}  // namespace lenticule::render
