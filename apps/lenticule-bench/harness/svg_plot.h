// SPDX-License-Identifier: Apache-2.0
// Plot is a line plot, written as SVG; benchmarks use it.
#pragma once

#include <string>
#include <vector>

#include "optics/vec.h"

namespace lenticule::bench {

enum class AxisScale { Linear, Log };

struct PlotAxis {
  std::string label;
  AxisScale scale = AxisScale::Linear;
};

struct PlotSeries {
  std::string label;
  std::vector<Vec2> points;  ///< drawn in this order, each marked by a dot
  bool joined = true;        ///< connected by a line
  /// Names of points, shown under the mouse pointer; may be fewer than points.
  std::vector<std::string> names = {};
};

struct Plot {
  std::string title;
  PlotAxis x;
  PlotAxis y;
  std::vector<PlotSeries> series;
};

/// Returns round numbers that begin at or below `low` and end at or above `high`, ascending, at
/// least two. A linear axis over positive numbers begins at 0. A logarithmic axis has ticks at 1,
/// 2, 5, 10 for less than three decades, else at 1, 10, 100. Throws Error(Usage) for numbers that
/// are not finite, and on a logarithmic axis for numbers that are not positive.
[[nodiscard]] std::vector<double> axis_ticks(double low, double high, AxisScale scale);

/// Returns a complete SVG document of 720 by 420 units. Throws Error(Usage) as axis_ticks() does,
/// and for a plot without a point.
[[nodiscard]] std::string svg_of(const Plot& plot);

/// Writes svg_of(plot). Throws Error(Failed) if the file cannot be written.
void write_svg(const Plot& plot, const std::string& file);

}  // namespace lenticule::bench
