// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/pattern.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "base/statistics.h"
#include "frames/srgb.h"

namespace lenticule::calib {
namespace {

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
uint64_t parts_of_turn(double turns) {
  const double part = turns - std::floor(turns);
  return static_cast<uint64_t>(std::min(part, 1.0 - 0x1p-53) * 0x1p64);
}

const SinusoidCodes& sinusoid() {
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

void draw_marks(const MarkCells& cells, const Pattern& pattern, int j, uint8_t* row) {
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

}  // namespace

MarkCells MarkCells::of(const optics::Panel& panel, bool coded) {
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

bool MarkCells::lit(int cell, int mark, int code) {
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

bool MarkCells::covers(double x_px, double y_px) const {
  const double around = border + 2.0;
  return x_px > left - around && x_px < left + count * cell_width + around && y_px > top - around &&
         y_px < top + height + around;
}

void draw_pattern(const Pattern& pattern, const optics::Panel& panel, frames::WovenFrame& frame) {
  const frames::FrameGeometry geometry{.width = panel.width_px, .height = panel.height_px};
  if (frame.geometry() != geometry) frame = frames::WovenFrame(geometry);
  const RowPainter painter(pattern, panel);
  const MarkCells cells = MarkCells::of(panel, pattern.code != kNoCode);
  for_rows(panel.height_px, [&](int j) {
    painter.paint(j, frame.row(j));
    if (pattern.mark != kNoMark) draw_marks(cells, pattern, j, frame.row(j));
  });
}

std::vector<double> phase_steps(int count) {
  std::vector<double> phases;
  int stride = std::max(1, static_cast<int>(std::lround(count * 0.38)));
  while (std::gcd(stride, count) != 1) ++stride;
  for (int k = 0; k < count; ++k) phases.push_back(static_cast<double>(k * stride % count) / count);
  return phases;
}

GreyPicture grey_of(const CameraPicture& picture, const ChannelWeights& weights) {
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

namespace {

constexpr float kLeastLight = 0.15F;  ///< fraction of the light of a bright panel pixel
constexpr double kBrightPart = 0.98;

}  // namespace

std::vector<uint32_t> visible_pixels(const GreyPicture& dark, const GreyPicture& white) {
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

double part_of(const std::vector<uint32_t>& pixels, const GreyPicture& picture) {
  return picture.size() == 0
             ? 0.0
             : static_cast<double>(pixels.size()) / static_cast<double>(picture.size());
}

double mean_of(const GreyPicture& picture, const std::vector<uint32_t>& pixels) {
  double sum = 0.0;
  for (const uint32_t i : pixels) sum += picture.light[i];
  return pixels.empty() ? 0.0 : sum / static_cast<double>(pixels.size());
}

}  // namespace lenticule::calib
