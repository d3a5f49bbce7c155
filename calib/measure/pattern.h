// SPDX-License-Identifier: Apache-2.0
// What calibration shows on the panel: pictures given by a formula for each subpixel, in linear
// light. docs/calibration.md says what each is good for.
#pragma once

#include <array>
#include <cstdint>
#include <variant>
#include <vector>

#include "frames/frame.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// The whole panel at one light, 0 to 1 per channel.
struct Flat {
  std::array<double, 3> light{};
};

/// A sinusoid that is as fine as the lenses: light 1/2 + depth/2 cos(2 pi (s / pitch - phase)),
/// s = 3 [(X - W/2) + slant (Y - H/2)] in subpixels. Seen through the sheet it turns into a few
/// wide fringes.
struct Fringe {
  double pitch_subpx = 0.0;
  double slant = 0.0;
  double phase = 0.0;  ///< in turns
};

/// A wide sinusoid along one axis: light 1/2 + depth/2 cos(2 pi (X / period - phase)), X in pixels
/// from the left, or Y from the top. It tells which panel point a camera pixel sees.
struct Wave {
  bool vertical = false;  ///< varies from the top down
  double period_px = 0.0;
  double phase = 0.0;
};

/// Phi = constant + per_px_x (X - W/2) + per_px_y (Y - H/2), lenses: what one eye sees of a perfect
/// sheet, but for a few hundredths of a lens.
struct LinearPhase {
  double constant = 0.0;
  double per_px_x = 0.0;
  double per_px_y = 0.0;

  [[nodiscard]] double at(Vec2 panel_px, const optics::Panel& panel) const {
    return constant + per_px_x * (panel_px.x - panel.width_px / 2.0) +
           per_px_y * (panel_px.y - panel.height_px / 2.0);
  }
  [[nodiscard]] double pitch_subpx() const { return 3.0 / per_px_x; }
  [[nodiscard]] double slant() const { return per_px_y / per_px_x; }
};

/// Light only under one place of each lens as an eye sees it: |f - place| < width / 2.
struct Comb {
  LinearPhase phase;
  double place = 0.0;  ///< in lenses, [-1/2, 1/2)
  double width = 0.0;
};

/// Columns of one pixel, lit and dark in turn: a link that halves the colours smears them.
struct Columns {};
/// Squares of one pixel, lit and dark in turn: a panel that scales shows them as broad bands.
struct Checks {};

/// Subpixels that carry a pattern; the others stay dark.
struct Channels {
  bool red = true;
  bool green = true;
  bool blue = true;

  [[nodiscard]] bool has(int channel) const {
    return channel == 0 ? red : channel == 1 ? green : blue;
  }
  static Channels only(int channel) { return {channel == 0, channel == 1, channel == 2}; }
};

/// How deep fringes and waves are modulated.
inline constexpr double kPatternDepth = 0.9;
/// A mark counts modulo this.
inline constexpr int kMarkCounts = 4;
inline constexpr int kNoMark = -1;
/// A code is a number of so many bits (rig_code.h).
inline constexpr int kCodeBits = 3;
inline constexpr int kNoCode = -1;

struct Pattern {
  std::variant<Flat, Fringe, Wave, Comb, Columns, Checks> shape;
  Channels channels;
  /// 0 to kMarkCounts - 1: the number that the marks show; kNoMark = no marks.
  int mark = kNoMark;
  /// 0 to 2^kCodeBits - 1: shown by further cells beside the marks; kNoCode = there are none.
  int code = kNoCode;
};

/// The marks: cells in the middle of the panel, from the left always lit, bit 0, bit 1, odd parity,
/// and the bits of the code if there is one. They are wide enough for any sheet's blur and tell a
/// camera which picture it sees. What cannot be measured under them is bridged from all sides,
/// which at an edge it could not be.
struct MarkCells {
  static constexpr int kMarks = 4;
  static constexpr int kMost = kMarks + kCodeBits;
  int count = kMarks;
  int left = 0;
  int top = 0;
  int cell_width = 0;
  int height = 0;
  int border = 0;  ///< dark pixels around all cells

  [[nodiscard]] static MarkCells of(const optics::Panel& panel, bool coded);
  [[nodiscard]] static bool lit(int cell, int mark, int code);
  /// True inside any cell or the border.
  [[nodiscard]] bool covers(double x_px, double y_px) const;
};

/// A frame of the panel's size; `frame` is made anew where it has another. Uses every processor.
void draw_pattern(const Pattern& pattern, const optics::Panel& panel, frames::WovenFrame& frame);

/// `count` phases, evenly spread over a turn, in an order that spreads what drifts: consecutive
/// ones are far apart.
[[nodiscard]] std::vector<double> phase_steps(int count);

}  // namespace lenticule::calib
