// SPDX-License-Identifier: Apache-2.0
// ChartPainter draws the test patterns of calibration by eye as woven frames, subpixel by subpixel,
// with the same optical model as all other rendering.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frames/frame.h"
#include "optics/rig.h"

namespace lenticule::frames {

// Chart describes a test pattern for calibration by eye, as data: the procedure makes it, charts.h
// draws it.

enum class ChartPattern {
  PixelLines,     ///< lines of one pixel, to check that the link keeps pixels unchanged
  Bands,          ///< a comb per band, each with another pitch
  Comb,           ///< white where the eye should look, |place| < 1/8; black elsewhere
  TwoViews,       ///< red for the left half of a viewing zone, green for the right half
  NumberedViews,  ///< every view shows its number, the leftmost 0
  SlantBands,     ///< a comb per column, each with another slant
  Ladder          ///< rungs in a small window: red and green, each rung shifted sideways a little
};

/// Number of bands of ChartPattern::Bands, from the top; pitches rise from one band to the next,
/// and the middle band has the rig's pitch. SlantBands has as many columns, from the left, with
/// rising slants; Ladder as many rungs, from the top, with falling offsets.
inline constexpr int kBands = 25;

/// Window of a ladder, as fractions of the panel.
inline constexpr double kLadderWidth = 1.0 / 8.0;
inline constexpr double kLadderHeight = 1.0 / 4.0;

struct Chart {
  ChartPattern pattern = ChartPattern::Comb;
  /// The edited rig; its viewing line is the position of the eye that looks at the chart.
  optics::Rig rig = {};
  /// Bands: the pitches are the rig's times 1 - reach ... 1 + reach. SlantBands: the slants are the
  /// rig's - reach ... + reach. Ladder: the offsets are the rig's + reach ... - reach, in lenses.
  double band_reach = 0.0;
  int cursor = 0;  ///< the marked band; none if out of range
  /// Ladder: the middle of the window, in panels from the panel's centre; x right, y down.
  double ladder_x = 0.0;
  double ladder_y = 0.0;
  bool magnifier = false;
  std::vector<std::string> words =
      {};  ///< one paragraph each, in a box at the bottom; empty = none
  bool words_on_top = false;
};

/// Returns the pitch of band `band` divided by the pitch of the rig.
[[nodiscard]] inline double band_scale(int band, double reach) {
  return 1.0 + reach * (2.0 * band / (kBands - 1) - 1.0);
}

/// Returns the value of band `band` minus that of the middle band, for SlantBands and Ladder.
[[nodiscard]] inline double band_shift(ChartPattern pattern, int band, double reach) {
  const double shift = band_scale(band, reach) - 1.0;
  return pattern == ChartPattern::Ladder ? -shift : shift;
}

/// Returns the position of the middle of a rung, in panels below the panel's centre.
[[nodiscard]] inline double rung_y(double ladder_y, int rung) {
  return ladder_y + kLadderHeight * ((rung + 0.5) / kBands - 0.5);
}

/// ChartPainter draws one chart. Immutable.
class ChartPainter {
 public:
  /// Throws Error(Input) for a rig that has no optical model.
  explicit ChartPainter(const Chart& chart);
  ~ChartPainter();

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
