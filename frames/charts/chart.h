// SPDX-License-Identifier: Apache-2.0
// Chart describes a test pattern for calibration by eye, as data: the procedure makes it, charts.h
// draws it.
#pragma once

#include <string>
#include <vector>

#include "optics/rig.h"

namespace lenticule::frames {

enum class ChartPattern {
  PixelLines,    ///< lines of one pixel, to check that the link keeps pixels unchanged
  Bands,         ///< a comb per band, each with another pitch
  Comb,          ///< white where the eye should look, |place| < 1/8; black elsewhere
  TwoViews,      ///< red for the left half of a viewing zone, green for the right half
  NumberedViews  ///< every view shows its number, the leftmost 0
};

/// Number of bands of ChartPattern::Bands, from the top; pitches rise from one band to the next,
/// and the middle band has the rig's pitch.
inline constexpr int kBands = 25;

struct Chart {
  ChartPattern pattern = ChartPattern::Comb;
  /// The edited rig; its viewing line is the position of the eye that looks at the chart.
  optics::Rig rig = {};
  /// Bands: the pitches are the rig's times 1 - reach ... 1 + reach.
  double band_reach = 0.0;
  int cursor = 0;  ///< the marked band
  /// Comb: blue lines along the lenses, with the rig's slant.
  bool lens_lines = false;
  bool magnifier = false;
  std::vector<std::string> words =
      {};  ///< one paragraph each, in a box at the bottom; empty = none
};

/// Returns the pitch of band `band` divided by the pitch of the rig.
[[nodiscard]] inline double band_scale(int band, double reach) {
  return 1.0 + reach * (2.0 * band / (kBands - 1) - 1.0);
}

}  // namespace lenticule::frames
