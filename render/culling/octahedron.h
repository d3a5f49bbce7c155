// SPDX-License-Identifier: Apache-2.0
// Maps directions to an octahedron that is unfolded to the square [-1, 1] x [-1, 1]: the upper half
// is the diamond in the middle of the square, the lower half its corners.
#pragma once

#include <cmath>
#include <utility>

#include "optics/vec.h"

namespace lenticule::render {

/// Returns the direction, not normalized, at a point of the square.
[[nodiscard]] inline Vec3f octahedron_direction(float x, float y) {
  const float z = 1.0F - std::abs(x) - std::abs(y);
  if (z >= 0.0F) return {x, y, z};
  return {std::copysign(1.0F - std::abs(y), x), std::copysign(1.0F - std::abs(x), y), z};
}

/// DirectionCell describes one of n x n equal cells of the square: a unit direction inside the cell
/// and the cosine of the angle from it to the farthest direction of the cell, reduced slightly for
/// rounding. n is even, so that the folds run through corners of cells; then the farthest direction
/// is at a corner.
struct DirectionCell {
  Vec3f middle{};
  float cosine = 1.0F;
};
[[nodiscard]] inline DirectionCell direction_cell(int u, int v, int n) {
  const float step = 2.0F / static_cast<float>(n);
  const auto at = [&](float du, float dv) {
    return normalized(octahedron_direction((static_cast<float>(u) + du) * step - 1.0F,
                                           (static_cast<float>(v) + dv) * step - 1.0F));
  };
  DirectionCell cell{.middle = at(0.5F, 0.5F)};
  for (const float du : {0.0F, 1.0F})
    for (const float dv : {0.0F, 1.0F})
      cell.cosine = std::fmin(cell.cosine, dot(cell.middle, at(du, dv)));
  cell.cosine -= 1e-5F;
  return cell;
}

}  // namespace lenticule::render
