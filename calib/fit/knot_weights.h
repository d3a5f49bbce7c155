// SPDX-License-Identifier: Apache-2.0
// Computes the weights of a residual map's knots at a panel point; the map is linear in its knots.
#pragma once

#include <vector>

#include "optics/vec.h"

namespace lenticule::calib {

struct KnotWeight {
  int knot = 0;  ///< row * columns + column
  double weight = 0.0;
};

struct KnotGrid {
  int columns = 0;
  int rows = 0;
  [[nodiscard]] int count() const { return columns * rows; }
};

/// Returns the weights of the at most 16 knots with which optics::ResidualSpline evaluates panel
/// point (x, y), in pixels, of a panel of that size.
[[nodiscard]] std::vector<KnotWeight> knot_weights(const KnotGrid& grid, Vec2 panel_px,
                                                   int width_px, int height_px);

}  // namespace lenticule::calib
