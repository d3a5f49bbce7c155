// SPDX-License-Identifier: Apache-2.0
// A scene archive as one list of bytes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "base/error.h"
#include "render/loaders/scene_archive.h"

namespace lenticule::test {

/// Writes the archive in pieces of this size.
inline std::vector<uint8_t> archive_of(const render::SceneDescription& scene,
                                       size_t piece_bytes = size_t{1} << 20) {
  std::vector<uint8_t> bytes;
  std::vector<uint8_t> piece(piece_bytes);
  render::write_scene_archive(scene, [&](size_t written) {
    bytes.insert(bytes.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(written));
    return std::span<uint8_t>(piece);
  });
  return bytes;
}

/// Reads an archive in pieces of this size.
inline render::SceneDescription scene_of(std::span<const uint8_t> bytes,
                                         size_t piece_bytes = size_t{1} << 20) {
  return render::read_scene_archive([&]() -> std::span<const uint8_t> {
    if (bytes.empty()) throw Error(ErrorKind::Input, "ends early");
    const auto piece = bytes.first(std::min(piece_bytes, bytes.size()));
    bytes = bytes.subspan(piece.size());
    return piece;
  });
}

}  // namespace lenticule::test
