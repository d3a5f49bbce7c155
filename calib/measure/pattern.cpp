// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/pattern.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "calib/measure/rows.h"
#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

/// Codes of one turn of the sinusoid: fine enough that its steps are far below one code.
class SinusoidCodes {
 public:
  SinusoidCodes() {
    for (size_t i = 0; i < kSteps; ++i) {
      const double turn = (static_cast<double>(i) + 0.5) / kSteps;
      const double light = 0.5 + 0.5 * kPatternDepth * std::cos(2.0 * std::numbers::pi * turn);
      codes_[i] = frames::code_from_linear(light);
    }
  }
  [[nodiscard]] uint8_t at(double turns) const {
    const double part = turns - std::floor(turns);
    return codes_[std::min(kSteps - 1, static_cast<size_t>(part * kSteps))];
  }

 private:
  static constexpr size_t kSteps = 4096;
  std::array<uint8_t, kSteps> codes_{};
};

const SinusoidCodes& sinusoid() {
  static const SinusoidCodes codes;
  return codes;
}

/// One row of one kind of pattern.
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

  void fill(const Fringe& fringe, int j, uint8_t* row) const {
    const double per_px = 3.0 / fringe.pitch_subpx;
    const Vec2 middle{panel_.width_px / 2.0, panel_.height_px / 2.0};
    each(j, row, [&](Vec2 p, int, int) {
      const double s = (p.x - middle.x) + fringe.slant * (p.y - middle.y);
      return sinusoid().at(s * per_px - fringe.phase);
    });
  }

  void fill(const Wave& wave, int j, uint8_t* row) const {
    each(j, row, [&](Vec2 p, int, int) {
      return sinusoid().at((wave.vertical ? p.y : p.x) / wave.period_px - wave.phase);
    });
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

void draw_marks(const MarkCells& cells, int mark, int j, uint8_t* row) {
  const int border = cells.height / 4;
  if (j >= cells.top + cells.height + border) return;
  const int right = cells.left + MarkCells::kCount * cells.cell_width + border;
  std::fill(row, row + 3 * right, uint8_t{0});
  if (j < cells.top || j >= cells.top + cells.height) return;
  for (int cell = 0; cell < MarkCells::kCount; ++cell) {
    if (!MarkCells::lit(cell, mark)) continue;
    uint8_t* const begin = row + 3 * (cells.left + cell * cells.cell_width);
    std::fill(begin, begin + 3 * cells.cell_width, uint8_t{255});
  }
}

}  // namespace

MarkCells MarkCells::of(const optics::Panel& panel) {
  // A sixtieth of the width is five lenses of twelve pixels on a 4K panel.
  return {.left = 0,
          .top = 0,
          .cell_width = std::max(2, panel.width_px / 60),
          .height = std::max(2, panel.height_px / 34)};
}

bool MarkCells::lit(int cell, int mark) {
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

bool MarkCells::covers(double x_px, double y_px) const {
  const double border = height / 4 + 2.0;
  return x_px < left + kCount * cell_width + border && y_px < top + height + border;
}

void draw_pattern(const Pattern& pattern, const optics::Panel& panel, frames::WovenFrame& frame) {
  const frames::FrameGeometry geometry{.width = panel.width_px, .height = panel.height_px};
  if (frame.geometry() != geometry) frame = frames::WovenFrame(geometry);
  const RowPainter painter(pattern, panel);
  const MarkCells cells = MarkCells::of(panel);
  for_rows(panel.height_px, [&](int j) {
    painter.paint(j, frame.row(j));
    if (pattern.mark != kNoMark) draw_marks(cells, pattern.mark, j, frame.row(j));
  });
}

std::vector<double> phase_steps(int count) {
  std::vector<double> phases;
  int stride = std::max(1, static_cast<int>(std::lround(count * 0.38)));
  while (std::gcd(stride, count) != 1) ++stride;
  for (int k = 0; k < count; ++k) phases.push_back(static_cast<double>(k * stride % count) / count);
  return phases;
}

}  // namespace lenticule::calib
