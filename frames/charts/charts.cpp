// SPDX-License-Identifier: Apache-2.0
#include "frames/charts/charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "base/parallel_rows.h"
#include "frames/compare.h"
#include "frames/text.h"
#include "optics/row_rays.h"

namespace lenticule::frames {
namespace {

using frames::Colour;
using frames::WovenFrame;

constexpr uint8_t kLit = 255;
constexpr Colour kWhite = {255, 255, 255};
constexpr Colour kBlack = {0, 0, 0};
constexpr Colour kBlue = {0, 0, 255};
constexpr size_t kRed = 0, kGreen = 1;

constexpr double kCombHalfWidth = 0.125;
/// A detail that must look like one thing through the sheet covers this many lenses across.
constexpr double kLensesPerDot = 2.0;
constexpr int kNumbersAcross = 5;
/// Subpixels of one colour are three apart: narrower views would show their neighbours' numbers.
constexpr int kSubpixelsPerNumber = 2;

/// Returns the place under the nearest lens, -1/2 ... 1/2. Adding and subtracting 1.5 * 2^52 rounds
/// to the nearest integer without a branch.
double place_of(double phase) {
  constexpr double kRounder = 0x1.8p52;
  return phase - ((phase + kRounder) - kRounder);
}

double lens_px(const optics::Rig& rig) { return rig.sheet.pitch.value / 3.0; }

/// Returns the pixels per dot of the font: wide enough for the lenses, large enough for the viewing
/// distance.
int text_scale(const optics::Rig& rig) {
  const double broad = kLensesPerDot * lens_px(rig);
  const double large = rig.panel.height_px / 240.0;
  const double fits = rig.panel.width_px / (24.0 * frames::kCellWidth);
  return std::max(1, static_cast<int>(std::min(std::max(broad, large), fits)));
}

/// NumberCells draws the numbers of all views, each in the same cell, as dots of the font.
class NumberCells {
 public:
  NumberCells(const optics::Rig& rig, int views) {
    size_t digits = 1;
    for (int n = 0; n < views; ++n) {
      texts_.push_back(fmt::format("{}", n));
      digits = std::max(digits, texts_.back().size());
    }
    for (std::string& text : texts_) text.insert(0, digits - text.size(), ' ');
    const int dots = static_cast<int>(digits) * frames::kCellWidth + 2;
    scale_ = std::max(1, rig.panel.width_px / (kNumbersAcross * dots));
    width_ = dots * scale_;
    height_ = (frames::kCellHeight + 2) * scale_;
  }

  /// Sets the pixels of row j that are lit in each view, for one cell across: lit[view * width() +
  /// i].
  void row(int j, std::vector<uint8_t>& lit) const {
    lit.assign(texts_.size() * static_cast<size_t>(width_), 0);
    const int dot_row = j % height_ / scale_ - 1;
    if (dot_row < 0 || dot_row >= frames::kGlyphHeight) return;
    for (size_t view = 0; view < texts_.size(); ++view)
      for (int i = 0; i < width_; ++i)
        lit[view * static_cast<size_t>(width_) + static_cast<size_t>(i)] =
            is_dot(texts_[view], i / scale_ - 1, dot_row) ? kLit : 0;
  }
  [[nodiscard]] int width() const { return width_; }

 private:
  static bool is_dot(const std::string& text, int column, int row) {
    if (column < 0 || column % frames::kCellWidth >= frames::kGlyphWidth) return false;
    const auto character = static_cast<size_t>(column / frames::kCellWidth);
    if (character >= text.size()) return false;
    const uint8_t dots = frames::glyph_of(text[character]).at(static_cast<size_t>(row));
    return (dots >> (frames::kGlyphWidth - 1 - column % frames::kCellWidth) & 1) != 0;
  }

  std::vector<std::string> texts_;
  int scale_ = 1;
  int width_ = 1;
  int height_ = 1;
};

/// Returns an odd number, so that the middle of a zone is the middle of a view.
int numbered_views(const optics::Rig& rig) {
  const int possible = frames::native_view_count(rig) / kSubpixelsPerNumber;
  return std::clamp(possible - (possible % 2 == 0 ? 1 : 0), 3, 99);
}

/// Draws text in a box at the bottom or at the top. Text beyond two fifths of the height is
/// omitted, because the pattern is more important.
void draw_words(const Chart& chart, WovenFrame& frame) {
  const int scale = text_scale(chart.rig);
  const int line = frames::kCellHeight * scale;
  const auto columns =
      static_cast<size_t>(std::max(1, frame.width() / (frames::kCellWidth * scale) - 2));
  std::vector<std::string> lines;
  for (const std::string& paragraph : chart.words)
    for (std::string& text : frames::wrap_text(paragraph, columns))
      lines.push_back(std::move(text));
  const int fit = std::max(1, (frame.height() * 2 / 5 - line / 2) / line);
  if (static_cast<int>(lines.size()) > fit) lines.resize(static_cast<size_t>(fit));
  const int height = static_cast<int>(lines.size()) * line + line / 2;
  int y = chart.words_on_top ? 0 : frame.height() - height;
  frames::fill_box(frame, {0, y, frame.width(), height}, kBlack);
  y += line / 4;
  for (const std::string& text : lines) {
    frames::draw_text(frame, frames::kCellWidth * scale, y, scale, text, kWhite);
    y += line;
  }
}

}  // namespace

struct ChartPainter::Prepared {
  explicit Prepared(const Chart& source)
      : chart(source),
        model(source.rig),
        phases(model, model.design_eye()),
        views(numbered_views(source.rig)),
        numbers(source.rig, views),
        centre_phase(model.phase(source.rig.panel.width_px / 2.0, source.rig.panel.height_px / 2.0,
                                 kGreen, model.design_eye())) {}

  void comb_row(const std::vector<double>& phase, uint8_t* row) const {
    for (size_t s = 0; s < phase.size(); ++s)
      row[s] = std::abs(place_of(phase[s])) < kCombHalfWidth ? kLit : 0;
  }

  /// Draws a row of a band. A pitch that differs by a factor only scales the phase around the
  /// panel's centre.
  void band_row(const std::vector<double>& phase, int j, uint8_t* row) const {
    const int height = chart.rig.panel.height_px, width = chart.rig.panel.width_px;
    const int band = std::min(kBands - 1, static_cast<int>(int64_t{j} * kBands / height));
    const int top = height * band / kBands, rows = std::max(1, height / kBands);
    if (rows >= 8 && j - top < rows / 8) return;  // a black line above each band
    const double scale = 1.0 / band_scale(band, chart.band_reach);
    for (size_t s = 0; s < phase.size(); ++s) {
      const double scaled = centre_phase + (phase[s] - centre_phase) * scale;
      row[s] = std::abs(place_of(scaled)) < kCombHalfWidth ? kLit : 0;
    }
    if (band != chart.cursor) return;
    const int blue = std::max(1, width / 24);
    mark(0, blue, row);
    mark(width - blue, width, row);
  }

  /// Draws a row of columns with different slants. A slant that differs a little moves the phase in
  /// proportion to the distance from the panel's middle row.
  void slant_band_row(const std::vector<double>& phase, int j, uint8_t* row) const {
    const int height = chart.rig.panel.height_px, width = chart.rig.panel.width_px;
    const double lenses_per_slant =
        3.0 * (j + 0.5 - height / 2.0) / optics::effective_sheet(chart.rig).pitch.value;
    const int blue = std::max(1, height / 24);
    for (int band = 0; band < kBands; ++band) {
      const int left = width * band / kBands, right = width * (band + 1) / kBands;
      const double shift =
          lenses_per_slant * band_shift(ChartPattern::SlantBands, band, chart.band_reach);
      const int line = right - left >= 8 ? (right - left) / 8 : 0;  // black, between the columns
      for (int s = 3 * (left + line); s < 3 * right; ++s)
        row[s] =
            std::abs(place_of(phase[static_cast<size_t>(s)] + shift)) < kCombHalfWidth ? kLit : 0;
      if (band == chart.cursor && (j < blue || j >= height - blue)) mark(left, right, row);
    }
  }

  /// Draws a row of a ladder: one rung in red and green, each side of the marked rung in blue.
  void ladder_row(std::vector<double>& phase, int j, uint8_t* row) const {
    const int height = chart.rig.panel.height_px, width = chart.rig.panel.width_px;
    const double place = ((j + 0.5) / height - 0.5 - chart.ladder_y) / kLadderHeight + 0.5;
    const int rung = static_cast<int>(std::floor(place * kBands));
    if (rung < 0 || rung >= kBands) return;
    const double middle = width * (0.5 + chart.ladder_x), half = 0.5 * width * kLadderWidth;
    const int left = std::max(0, static_cast<int>(middle - half));
    const int right = std::min(width, static_cast<int>(middle + half));
    for (double& value : phase) value += band_shift(ChartPattern::Ladder, rung, chart.band_reach);
    two_view_row(phase, row, left, right);
    if (rung != chart.cursor) return;
    const int blue = std::max(1, width / 24);
    mark(left - blue, left, row);
    mark(right, right + blue, row);
  }

  void mark(int begin, int end, uint8_t* row) const {
    for (int i = std::max(0, begin); i < std::min(end, chart.rig.panel.width_px); ++i)
      std::copy(kBlue.begin(), kBlue.end(), row + 3 * i);
  }

  /// Draws the pixels [begin, end).
  void two_view_row(const std::vector<double>& phase, uint8_t* row, int begin, int end) const {
    for (size_t s = 3 * static_cast<size_t>(begin); s < 3 * static_cast<size_t>(end); s += 3) {
      row[s + kRed] = place_of(phase[s + kRed]) > 0.0 ? kLit : 0;
      row[s + kGreen] = place_of(phase[s + kGreen]) < 0.0 ? kLit : 0;
    }
  }

  void number_row(const std::vector<double>& phase, int j, uint8_t* row) const {
    std::vector<uint8_t> lit;
    numbers.row(j, lit);
    const size_t width = static_cast<size_t>(numbers.width());
    size_t column = 0;
    for (size_t s = 0; s < phase.size(); ++s) {
      const double number = optics::view_number(place_of(phase[s]), views);
      const auto view = static_cast<size_t>(std::clamp(static_cast<int>(number), 0, views - 1));
      row[s] = lit[view * width + column];
      if (s % 3 == 2 && ++column == width) column = 0;
    }
  }

  void line_row(int j, uint8_t* row) const {
    const int width = chart.rig.panel.width_px;
    for (int i = 0; i < width; ++i) row[3 * i + (i < width / 2 ? i : j) % 3] = kLit;
  }

  /// Draws the pixels around the panel's centre as squares in the upper left corner.
  void magnify(WovenFrame& frame) const {
    constexpr int kAcross = 24, kDown = 16;
    const int zoom = std::max(2, std::min(frame.width() / 3 / kAcross, frame.height() / 3 / kDown));
    const int x0 = std::max(0, (frame.width() - kAcross) / 2);
    const int y0 = std::max(0, (frame.height() - kDown) / 2);
    std::array<Colour, static_cast<size_t>(kAcross) * kDown> seen{};
    for (int j = 0; j < std::min(kDown, frame.height()); ++j)
      for (int i = 0; i < std::min(kAcross, frame.width()); ++i)
        std::copy_n(frame.row(y0 + j) + 3 * static_cast<ptrdiff_t>(x0 + i), 3,
                    seen.at(static_cast<size_t>(j * kAcross + i)).begin());
    frames::fill_box(frame, {0, 0, kAcross * zoom + 2 * zoom, kDown * zoom + 2 * zoom}, kWhite);
    for (int j = 0; j < kDown; ++j)
      for (int i = 0; i < kAcross; ++i)
        frames::fill_box(frame, {(i + 1) * zoom, (j + 1) * zoom, zoom, zoom},
                         seen.at(static_cast<size_t>(j * kAcross + i)));
  }

  Chart chart;
  optics::OpticalModel model;
  optics::RowPhaseEvaluator phases;
  int views;
  NumberCells numbers;
  double centre_phase;
};

ChartPainter::ChartPainter(const Chart& chart)
    : prepared_(std::make_unique<const Prepared>(chart)) {}
ChartPainter::~ChartPainter() = default;

void ChartPainter::paint_rows(int begin, int end, WovenFrame& frame) const {
  const Prepared& p = *prepared_;
  const optics::Panel& panel = p.chart.rig.panel;
  LENTICULE_CHECK(frame.width() == panel.width_px && frame.height() == panel.height_px);
  std::vector<double> phase;
  for (int j = begin; j < end; ++j) {
    uint8_t* const row = frame.row(j);
    std::fill_n(row, frame.geometry().row_bytes(), uint8_t{0});
    if (p.chart.pattern == ChartPattern::PixelLines) {
      p.line_row(j, row);
      continue;
    }
    p.phases.evaluate(j, 0, panel.width_px, phase);
    switch (p.chart.pattern) {
      case ChartPattern::Bands:
        p.band_row(phase, j, row);
        break;
      case ChartPattern::TwoViews:
        p.two_view_row(phase, row, 0, panel.width_px);
        break;
      case ChartPattern::SlantBands:
        p.slant_band_row(phase, j, row);
        break;
      case ChartPattern::Ladder:
        p.ladder_row(phase, j, row);
        break;
      case ChartPattern::NumberedViews:
        p.number_row(phase, j, row);
        break;
      default:
        p.comb_row(phase, row);
    }
  }
}

void ChartPainter::paint_words(WovenFrame& frame) const {
  if (prepared_->chart.magnifier) prepared_->magnify(frame);
  if (!prepared_->chart.words.empty()) draw_words(prepared_->chart, frame);
}

WovenFrame draw_chart(const Chart& chart) {
  const ChartPainter painter(chart);
  const optics::Panel& panel = chart.rig.panel;
  WovenFrame frame({.width = panel.width_px, .height = panel.height_px});
  for_row_ranges(panel.height_px,
                 [&](int begin, int end) { painter.paint_rows(begin, end, frame); });
  painter.paint_words(frame);
  return frame;
}

}  // namespace lenticule::frames
