// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/knot_weights.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lenticule::calib {
namespace {

using Line = std::vector<KnotWeight>;

void add(Line& line, int knot, double weight) {
  for (KnotWeight& known : line)
    if (known.knot == knot) {
      known.weight += weight;
      return;
    }
  line.push_back({knot, weight});
}

/// Adds the weight of a knot; a knot beyond the border extrapolates the last two in a straight
/// line.
void add_extended(Line& line, int knot, int count, double weight) {
  const int last = count - 1;
  if (knot >= 0 && knot <= last) return add(line, knot, weight);
  if (last == 0) return add(line, 0, weight);
  const int edge = knot < 0 ? 0 : last;
  const int inner = knot < 0 ? 1 : last - 1;
  const double beyond = knot < 0 ? -knot : knot - last;
  add(line, edge, weight * (1.0 + beyond));
  add(line, inner, -weight * beyond);
}

/// Returns the Catmull-Rom weights of a line of knots at grid coordinate `at`.
Line line_weights(double at, int count) {
  const double cell = std::clamp(std::floor(at), -1.0, count - 1.0);
  const double t = at - cell;
  const std::array<double, 4> weights = {t * (-0.5 + t * (1.0 - 0.5 * t)),
                                         1.0 + t * t * (-2.5 + 1.5 * t),
                                         t * (0.5 + t * (2.0 - 1.5 * t)), t * t * (-0.5 + 0.5 * t)};
  Line line;
  for (int k = 0; k < 4; ++k)
    add_extended(line, static_cast<int>(cell) + k - 1, count, weights[static_cast<size_t>(k)]);
  return line;
}

}  // namespace

std::vector<KnotWeight> knot_weights(const KnotGrid& grid, Vec2 panel_px, int width_px,
                                     int height_px) {
  const Line across = line_weights(panel_px.x * (grid.columns - 1.0) / width_px, grid.columns);
  const Line down = line_weights(panel_px.y * (grid.rows - 1.0) / height_px, grid.rows);
  std::vector<KnotWeight> weights;
  for (const KnotWeight& y : down)
    for (const KnotWeight& x : across)
      weights.push_back({y.knot * grid.columns + x.knot, x.weight * y.weight});
  return weights;
}

}  // namespace lenticule::calib
