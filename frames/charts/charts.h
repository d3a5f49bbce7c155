// SPDX-License-Identifier: Apache-2.0
// Draws the charts of calibration by eye as woven frames, subpixel by subpixel, through the same
// optical model that everything else is rendered with.
#pragma once

#include <memory>

#include "frames/charts/chart.h"
#include "frames/frame.h"

namespace lenticule::frames {

/// One chart, ready to be drawn. Immutable.
class ChartPainter {
 public:
  /// Throws Error(Input) for a rig that has no optical model.
  explicit ChartPainter(const Chart& chart);
  ~ChartPainter();
  ChartPainter(const ChartPainter&) = delete;
  ChartPainter& operator=(const ChartPainter&) = delete;

  /// Rows [begin, end) of a frame of the rig's panel, without words and magnifier. Safe from any
  /// number of threads for different rows.
  void paint_rows(int begin, int end, frames::WovenFrame& frame) const;
  /// Words and magnifier, over rows that are painted.
  void paint_words(frames::WovenFrame& frame) const;

 private:
  struct Prepared;
  std::unique_ptr<const Prepared> prepared_;
};

/// All of it, on as many threads as the machine has cores.
[[nodiscard]] frames::WovenFrame draw_chart(const Chart& chart);

}  // namespace lenticule::frames
