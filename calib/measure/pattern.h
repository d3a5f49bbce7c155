// SPDX-License-Identifier: Apache-2.0
// Pattern describes the pictures that calibration shows on the panel, by a formula for each
// subpixel, in linear light. docs/panel/calibration-method.md explains
// their purpose.
#pragma once

#include <array>
#include <cstdint>
#include <variant>
#include <vector>

#include "calib/camera.h"
#include "frames/frame.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// Flat is the whole panel at one light, 0 to 1 per channel.
struct Flat {
  std::array<double, 3> light{};
};

/// Fringe is a sinusoid as fine as the lenses: light 1/2 + depth/2 cos(2 pi (s / pitch - phase)), s
/// = 3 [(X - W/2) + slant (Y - H/2)] in subpixels. Through the sheet it appears as a few wide
/// fringes.
struct Fringe {
  double pitch_subpx = 0.0;
  double slant = 0.0;
  double phase = 0.0;  ///< turns
};

/// Wave is a wide sinusoid along one axis: light 1/2 + depth/2 cos(2 pi (X / period - phase)), X in
/// pixels from the left, or Y from the top. It encodes the panel point that a camera pixel sees.
struct Wave {
  bool vertical = false;  ///< varies from the top down
  double period_px = 0.0;
  double phase = 0.0;
};

/// LinearPhase is Phi = constant + per_px_x (X - W/2) + per_px_y (Y - H/2), lenses: the phase that
/// one eye sees of a perfect sheet, within a few hundredths of a lens.
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

/// Comb is light only under one place of each lens as an eye sees it: |f - place| < width / 2.
struct Comb {
  LinearPhase phase;
  double place = 0.0;  ///< lenses, [-1/2, 1/2)
  double width = 0.0;
};

/// Columns are columns of one pixel, alternately lit and dark: a link with chroma subsampling
/// smears them.
struct Columns {};
/// Checks are squares of one pixel, alternately lit and dark: a panel that scales shows broad
/// bands.
struct Checks {};

/// Channels are the subpixels that carry a pattern; the others stay dark.
struct Channels {
  bool red = true;
  bool green = true;
  bool blue = true;

  [[nodiscard]] bool has(int channel) const {
    return channel == 0 ? red : channel == 1 ? green : blue;
  }
  static Channels only(int channel) { return {channel == 0, channel == 1, channel == 2}; }
};

/// Modulation depth of fringes and waves.
inline constexpr double kPatternDepth = 0.9;
/// A mark counts modulo this.
inline constexpr int kMarkCounts = 4;
inline constexpr int kNoMark = -1;
/// Number of bits of a code (rig_code.h).
inline constexpr int kCodeBits = 3;
inline constexpr int kNoCode = -1;

struct Pattern {
  std::variant<Flat, Fringe, Wave, Comb, Columns, Checks> shape;
  Channels channels;
  /// Number of the marks, 0 to kMarkCounts - 1; kNoMark = no marks.
  int mark = kNoMark;
  /// Code, 0 to 2^kCodeBits - 1, shown by further cells beside the marks; kNoCode = no such cells.
  int code = kNoCode;
};

/// MarkCells are cells in the middle of the panel, from the left: always lit, bit 0, bit 1, odd
/// parity, and the bits of the code if there is one. They identify the pattern in a camera's
/// picture and are wide enough for any sheet's blur. The area under the marks cannot be measured;
/// in the middle it can be interpolated from all sides, at an edge it could not.
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
  /// Returns true inside any cell or the border.
  [[nodiscard]] bool covers(double x_px, double y_px) const;
};

/// Draws a frame of the panel's size; `frame` is allocated again if it has another size. Uses all
/// processors.
void draw_pattern(const Pattern& pattern, const optics::Panel& panel, frames::WovenFrame& frame);

/// Returns `count` phases, evenly distributed over a turn. Consecutive phases are far apart, which
/// distributes drift over the turn.
[[nodiscard]] std::vector<double> phase_steps(int count);

/// Rows from the top; linear light. `clipped` is not 0 where any channel of the camera was clipped.
struct GreyPicture {
  int width = 0;
  int height = 0;
  std::vector<float> light;
  std::vector<uint8_t> clipped;

  [[nodiscard]] size_t size() const { return light.size(); }
};

/// Weights of the camera's channels; they sum to 1.
using ChannelWeights = std::array<float, 3>;
inline constexpr ChannelWeights kEqualWeights{1.0F / 3.0F, 1.0F / 3.0F, 1.0F / 3.0F};

/// Returns the weighted sum of the camera's channels; a picture with one channel is unchanged.
[[nodiscard]] GreyPicture grey_of(const CameraPicture& picture,
                                  const ChannelWeights& weights = kEqualWeights);

// Selects the camera pixels that see the panel well enough for measuring.

/// Returns the pixels whose light differs between a white and a dark panel by a large part of the
/// panel's typical difference, and that are clipped in neither picture. This excludes the
/// surroundings of the panel, reflections and dead areas.
[[nodiscard]] std::vector<uint32_t> visible_pixels(const GreyPicture& dark,
                                                   const GreyPicture& white);

/// Returns the fraction of a picture's pixels, for messages.
[[nodiscard]] double part_of(const std::vector<uint32_t>& pixels, const GreyPicture& picture);

/// Returns the mean light of the pixels.
[[nodiscard]] double mean_of(const GreyPicture& picture, const std::vector<uint32_t>& pixels);

}  // namespace lenticule::calib
