// SPDX-License-Identifier: Apache-2.0
// Centres OBJ files that lie far from the origin, since assimp reads coordinates in single
// precision.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "optics/vec.h"

namespace lenticule::render {

struct CentredObj {
  std::vector<uint8_t> text;  ///< the file with all positions relative to the centre
  Vec3 centre;
};

/// Returns the file with the middle of its positions moved to the origin, if its distance from the
/// origin is a multiple of its size; otherwise nothing, as for files with continued lines or
/// homogeneous coordinates.
[[nodiscard]] std::optional<CentredObj> centre_obj(std::span<const uint8_t> file);

}  // namespace lenticule::render
