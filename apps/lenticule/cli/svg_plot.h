// SPDX-License-Identifier: Apache-2.0
// Line plots as SVG text: what benchmarks draw their growth with.
#pragma once

#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::player {

enum class AxisScale { Linear, Log };

struct PlotAxis {
  std::string label;
  AxisScale scale = AxisScale::Linear;
};

struct PlotSeries {
  std::string label;
  std::vector<Vec2> points;             ///< in this order, each marked by a dot
  bool joined = true;                   ///< by a line
  std::vector<std::string> names = {};  ///< of points, shown where one is pointed at; may be fewer
};

struct Plot {
  std::string title;
  PlotAxis x;
  PlotAxis y;
  std::vector<PlotSeries> series;
};

/// Round numbers that begin at or below `low` and end at or above `high`, ascending, two at least.
/// A linear axis over positive numbers begins at 0. A logarithmic one counts 1, 2, 5, 10 over less
/// than three decades, else 1, 10, 100. Throws Error(Usage) for numbers that are not finite, and
/// for a logarithmic axis for such as are not positive.
[[nodiscard]] std::vector<double> axis_ticks(double low, double high, AxisScale scale);

/// A whole SVG document of 720 by 420 units. Throws Error(Usage) where axis_ticks does and for a
/// plot without a point.
[[nodiscard]] std::string svg_of(const Plot& plot);

/// Writes svg_of(plot). Throws Error(Failed) if the file cannot be written.
void write_svg(const Plot& plot, const std::string& file);

}  // namespace lenticule::player
