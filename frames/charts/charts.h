// SPDX-License-Identifier: Apache-2.0
// ChartPainter draws the test patterns of calibration by eye as woven frames, subpixel by subpixel,
// with the same optical model as all other rendering.
#pragma once

#include <memory>

#include "frames/charts/chart.h"
#include "frames/frame.h"

namespace lenticule::frames {

/// ChartPainter draws one chart. Immutable.
class ChartPainter {
 public:
  /// Throws Error(Input) for a rig that has no optical model.
  explicit ChartPainter(const Chart& chart);
  ~ChartPainter();
  ChartPainter(const ChartPainter&) = delete;
  ChartPainter& operator=(const ChartPainter&) = delete;

  /// Draws rows [begin, end) of a frame of the rig's panel, without text and magnifier.
  ///
  /// Thread safety: any number of threads may draw different rows.
  void paint_rows(int begin, int end, frames::WovenFrame& frame) const;
  /// Draws text and magnifier over the painted rows.
  void paint_words(frames::WovenFrame& frame) const;

 private:
  struct Prepared;
  std::unique_ptr<const Prepared> prepared_;
};

/// Draws the whole chart, with one thread per core.
[[nodiscard]] frames::WovenFrame draw_chart(const Chart& chart);

}  // namespace lenticule::frames
