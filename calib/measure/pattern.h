// SPDX-License-Identifier: Apache-2.0
// Pattern describes the pictures that calibration shows on the panel, by a formula for each
// subpixel, in linear light. docs/panel/calibration-method.md explains
// their purpose.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <variant>
#include <vector>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "base/statistics.h"
#include "calib/camera.h"
#include "frames/frame.h"
#include "frames/srgb.h"
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

/// SinusoidCodes holds the codes of one turn of the sinusoid, in steps far below one code.
class SinusoidCodes {
 public:
  SinusoidCodes() {
    for (size_t i = 0; i < kSteps; ++i) {
      const double turn = (static_cast<double>(i) + 0.5) / kSteps;
      const double light = 0.5 + 0.5 * kPatternDepth * std::cos(2.0 * std::numbers::pi * turn);
      codes_[i] = frames::code_from_linear(light);
    }
  }
  /// Returns the code at a turn in parts of 2^64.
  [[nodiscard]] uint8_t at(uint64_t parts) const { return codes_[parts >> (64 - kBits)]; }

 private:
  static constexpr int kBits = 12;
  static constexpr size_t kSteps = size_t{1} << kBits;
  std::array<uint8_t, kSteps> codes_{};
};

/// Returns turns as parts of 2^64, without whole turns: sums of them are exact.
inline uint64_t parts_of_turn(double turns) {
  const double part = turns - std::floor(turns);
  return static_cast<uint64_t>(std::min(part, 1.0 - 0x1p-53) * 0x1p64);
}

inline const SinusoidCodes& sinusoid() {
  static const SinusoidCodes codes;
  return codes;
}

/// RowPainter draws one row of one kind of pattern.
class RowPainter {
 public:
  RowPainter(const Pattern& pattern, const optics::Panel& panel)
      : pattern_(pattern), panel_(panel) {}

  void paint(int j, uint8_t* row) const {
    std::visit([&](const auto& shape) { fill(shape, j, row); }, pattern_.shape);
  }

 private:
  template <class Code>
  void each(int j, uint8_t* row, Code code) const {
    for (int i = 0; i < panel_.width_px; ++i)
      for (int c = 0; c < 3; ++c)
        row[3 * i + c] =
            pattern_.channels.has(c) ? code(panel_.subpixel_centre_px(i, j, c), i, c) : uint8_t{0};
  }

  void fill(const Flat& flat, int j, uint8_t* row) const {
    std::array<uint8_t, 3> codes{};
    for (size_t c = 0; c < 3; ++c) codes[c] = frames::code_from_linear(flat.light[c]);
    each(j, row, [&](Vec2, int, int c) { return codes[static_cast<size_t>(c)]; });
  }

  /// Fills a row with a sinusoid whose turns at panel point p are p . per_px + constant.
  void fill_sinusoid(Vec2 per_px, double constant, int j, uint8_t* row) const {
    const SinusoidCodes& codes = sinusoid();
    const int period = panel_.layout.columns();
    const uint64_t step = parts_of_turn(per_px.x * period);
    for (int c = 0; c < 3; ++c) {
      const bool lit = pattern_.channels.has(c);
      for (int first = 0; first < std::min(period, panel_.width_px); ++first) {
        const Vec2 p = panel_.subpixel_centre_px(first, j, c);
        uint64_t parts = parts_of_turn(p.x * per_px.x + p.y * per_px.y + constant);
        for (int i = first; i < panel_.width_px; i += period, parts += step)
          row[3 * i + c] = lit ? codes.at(parts) : uint8_t{0};
      }
    }
  }

  void fill(const Fringe& fringe, int j, uint8_t* row) const {
    const Vec2 per_px{3.0 / fringe.pitch_subpx, 3.0 * fringe.slant / fringe.pitch_subpx};
    const double at_middle = per_px.x * panel_.width_px / 2.0 + per_px.y * panel_.height_px / 2.0;
    fill_sinusoid(per_px, -at_middle - fringe.phase, j, row);
  }

  void fill(const Wave& wave, int j, uint8_t* row) const {
    const double per_px = 1.0 / wave.period_px;
    fill_sinusoid(wave.vertical ? Vec2{0.0, per_px} : Vec2{per_px, 0.0}, -wave.phase, j, row);
  }

  void fill(const Comb& comb, int j, uint8_t* row) const {
    each(j, row, [&](Vec2 p, int, int) {
      const double off = comb.phase.at(p, panel_) - comb.place;
      return std::abs(off - std::round(off)) < 0.5 * comb.width ? uint8_t{255} : uint8_t{0};
    });
  }

  void fill(const Columns&, int j, uint8_t* row) const {
    each(j, row, [](Vec2, int i, int) { return i % 2 == 0 ? uint8_t{255} : uint8_t{0}; });
  }

  void fill(const Checks&, int j, uint8_t* row) const {
    each(j, row, [&](Vec2, int i, int) { return (i + j) % 2 == 0 ? uint8_t{255} : uint8_t{0}; });
  }

  const Pattern& pattern_;
  const optics::Panel& panel_;
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

  [[nodiscard]] static MarkCells of(const optics::Panel& panel, bool coded) {
    // A sixtieth of the width is five lenses of twelve pixels on a 4K panel.
    MarkCells cells;
    cells.count = coded ? kMost : kMarks;
    cells.cell_width = std::max(2, panel.width_px / 60);
    cells.height = std::max(2, panel.height_px / 34);
    // The edges of the marks show whether the camera was moved between photographs, so coded marks
    // need a border.
    cells.border = std::max(1, cells.height / (coded ? 2 : 4));
    cells.left = (panel.width_px - cells.count * cells.cell_width) / 2;
    cells.top = (panel.height_px - cells.height) / 2;
    return cells;
  }
  [[nodiscard]] static bool lit(int cell, int mark, int code) {
    if (cell >= kMarks) return (code >> (cell - kMarks) & 1) != 0;
    switch (cell) {
      case 0:
        return true;
      case 1:
        return (mark & 1) != 0;
      case 2:
        return (mark & 2) != 0;
      default:
        return ((mark & 1) != 0) != ((mark & 2) != 0);
    }
  }
  /// Returns true inside any cell or the border.
  [[nodiscard]] bool covers(double x_px, double y_px) const {
    const double around = border + 2.0;
    return x_px > left - around && x_px < left + count * cell_width + around &&
           y_px > top - around && y_px < top + height + around;
  }
};

inline void draw_marks(const MarkCells& cells, const Pattern& pattern, int j, uint8_t* row) {
  if (j < cells.top - cells.border || j >= cells.top + cells.height + cells.border) return;
  const int right = cells.left + cells.count * cells.cell_width;
  std::fill(row + 3 * (cells.left - cells.border), row + 3 * (right + cells.border), uint8_t{0});
  if (j < cells.top || j >= cells.top + cells.height) return;
  for (int cell = 0; cell < cells.count; ++cell) {
    if (!MarkCells::lit(cell, pattern.mark, pattern.code)) continue;
    uint8_t* const begin = row + 3 * (cells.left + cell * cells.cell_width);
    std::fill(begin, begin + 3 * cells.cell_width, uint8_t{255});
  }
}

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

// Selects the camera pixels that see the panel well enough for measuring.

/// Draws a frame of the panel's size; `frame` is allocated again if it has another size. Uses all
/// processors.
inline void draw_pattern(const Pattern& pattern, const optics::Panel& panel,
                         frames::WovenFrame& frame) {
  const frames::FrameGeometry geometry{.width = panel.width_px, .height = panel.height_px};
  if (frame.geometry() != geometry) frame = frames::WovenFrame(geometry);
  const RowPainter painter(pattern, panel);
  const MarkCells cells = MarkCells::of(panel, pattern.code != kNoCode);
  for_rows(panel.height_px, [&](int j) {
    painter.paint(j, frame.row(j));
    if (pattern.mark != kNoMark) draw_marks(cells, pattern, j, frame.row(j));
  });
}

/// Returns `count` phases, evenly distributed over a turn. Consecutive phases are far apart, which
/// distributes drift over the turn.
[[nodiscard]] inline std::vector<double> phase_steps(int count) {
  std::vector<double> phases;
  int stride = std::max(1, static_cast<int>(std::lround(count * 0.38)));
  while (std::gcd(stride, count) != 1) ++stride;
  for (int k = 0; k < count; ++k) phases.push_back(static_cast<double>(k * stride % count) / count);
  return phases;
}

/// Returns the weighted sum of the camera's channels; a picture with one channel is unchanged.
[[nodiscard]] inline GreyPicture grey_of(const CameraPicture& picture,
                                         const ChannelWeights& weights = kEqualWeights) {
  GreyPicture grey{.width = picture.width, .height = picture.height, .light = {}, .clipped = {}};
  const size_t count = static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height);
  const auto channels = static_cast<size_t>(picture.channels);
  LENTICULE_CHECK((channels == 1 || channels == 3) && picture.light.size() == count * channels);
  grey.light.resize(count);
  grey.clipped.resize(count);
  for_rows(picture.height, [&](int j) {
    const size_t begin = static_cast<size_t>(j) * static_cast<size_t>(picture.width);
    for (size_t i = begin; i < begin + static_cast<size_t>(picture.width); ++i) {
      const float* light = picture.light.data() + i * channels;
      float sum = light[0];
      float most = light[0];
      if (channels == 3) {
        sum = weights[0] * light[0] + weights[1] * light[1] + weights[2] * light[2];
        most = std::max({light[0], light[1], light[2]});
      }
      grey.light[i] = sum;
      grey.clipped[i] = most >= kSaturatedLight ? 1 : 0;
    }
  });
  return grey;
}

inline constexpr float kLeastLight = 0.15F;  ///< fraction of the light of a bright panel pixel
inline constexpr double kBrightPart = 0.98;

/// Returns the pixels whose light differs between a white and a dark panel by a large part of the
/// panel's typical difference, and that are clipped in neither picture. This excludes the
/// surroundings of the panel, reflections and dead areas.
[[nodiscard]] inline std::vector<uint32_t> visible_pixels(const GreyPicture& dark,
                                                          const GreyPicture& white) {
  std::vector<float> rise(white.size());
  for (size_t i = 0; i < rise.size(); ++i) rise[i] = white.light[i] - dark.light[i];
  const float bright =
      value_in_order(rise, static_cast<size_t>(kBrightPart * static_cast<double>(rise.size())));
  std::vector<uint32_t> pixels;
  for (size_t i = 0; i < rise.size(); ++i)
    if (rise[i] > kLeastLight * bright && dark.clipped[i] == 0 && white.clipped[i] == 0)
      pixels.push_back(static_cast<uint32_t>(i));
  return pixels;
}

/// Returns the fraction of a picture's pixels, for messages.
[[nodiscard]] inline double part_of(const std::vector<uint32_t>& pixels,
                                    const GreyPicture& picture) {
  return picture.size() == 0
             ? 0.0
             : static_cast<double>(pixels.size()) / static_cast<double>(picture.size());
}

/// Returns the mean light of the pixels.
[[nodiscard]] inline double mean_of(const GreyPicture& picture,
                                    const std::vector<uint32_t>& pixels) {
  double sum = 0.0;
  for (const uint32_t i : pixels) sum += picture.light[i];
  return pixels.empty() ? 0.0 : sum / static_cast<double>(pixels.size());
}

}  // namespace lenticule::calib
