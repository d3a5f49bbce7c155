// SPDX-License-Identifier: Apache-2.0
// Two facts make a tile cheap. Along a pixel row the phase seen from the design eye is a straight
// line plus what changes over the whole viewing distance: over a few millimetres a parabola fits it
// to a billionth of a lens. And without a residual map the ray of a subpixel depends, in its row,
// on one number only, the distance `rest` from the panel point to the apex line of its lens: one
// polynomial per row and range of that number serves the whole row.
#include "optics/tile_optics.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "optics/error.h"
#include "optics/row_rays.h"

namespace lenticule::optics {
namespace {

constexpr int kRows = TileOptics::kRows;
constexpr int kMost = TileOptics::kMostCoefficients;

/// Of a tangent; a subpixel's angular footprint is some 1e-2.
constexpr double kTangentTolerance = 2e-8;
/// Phases that the parabola misses by more would make too many subpixels ask for the exact lens.
constexpr double kMostPhaseError = 1e-5;

using Polynomial = std::array<double, kMost>;

/// Coefficients in powers of y in [-1, 1] of the polynomial through the Chebyshev points.
template <class Function>
Polynomial fit(int count, const Function& value) {
  std::array<double, kMost> chebyshev{};
  for (int k = 0; k < count; ++k) {
    const double angle = std::numbers::pi * (k + 0.5) / count;
    const double v = value(std::cos(angle));
    for (int n = 0; n < count; ++n)
      chebyshev[static_cast<size_t>(n)] += (n == 0 ? 1.0 : 2.0) / count * v * std::cos(n * angle);
  }
  // T_n in powers: T_n+1 = 2 y T_n - T_n-1.
  Polynomial sum{}, before{}, now{};
  now[0] = 1.0;
  for (int n = 0; n < count; ++n) {
    for (size_t i = 0; i < kMost; ++i) sum[i] += chebyshev[static_cast<size_t>(n)] * now[i];
    Polynomial next{};
    for (size_t i = 0; i < kMost; ++i) {
      if (i + 1 < kMost) next[i + 1] += (n == 0 ? 1.0 : 2.0) * now[i];
      if (n > 0) next[i] -= before[i];
    }
    before = now;
    now = next;
  }
  return sum;
}

double value_of(const Polynomial& p, double y) {
  double v = 0.0;
  for (size_t i = kMost; i-- > 0;) v = v * y + p[i];
  return v;
}

/// Only where x alone tells where a subpixel of a row lies.
bool serves(const Rig& rig) {
  const SubpixelLayout& layout = rig.panel.layout;
  if (layout.columns() != 1 || layout.rows() != 1 || !rig.sheet.residual.empty()) return false;
  const PixelCell& cell = layout.table().front();
  return cell[0].y_px == cell[1].y_px && cell[1].y_px == cell[2].y_px;
}

}  // namespace

struct TileOptics::Impl {
  Impl(const OpticalModel& m, int tile_columns, std::span<const int, kRows> tile_shifts)
      : model(m), phases(m, m.design_eye()), columns(tile_columns) {
    std::copy(tile_shifts.begin(), tile_shifts.end(), shifts.begin());
    const Rig& rig = model.rig();
    lenses_per_px = 3.0 / rig.sheet.pitch.value;
    rests_per_lens = model.pitch_mm() / rig.sheet.gap.value;
    set_nudges();
  }

  [[nodiscard]] const PixelCell& cell() const { return model.rig().panel.layout.table().front(); }

  /// x of a subpixel is s / 3 plus its colour's nudge.
  void set_nudges() {
    const Rig& rig = model.rig();
    for (int colour = 0; colour < 3; ++colour) {
      for (int row = 0; row < kRows; ++row) {
        const auto channel =
            static_cast<size_t>(((colour - shifts[static_cast<size_t>(row)]) % 3 + 3) % 3);
        const double nudge_px = cell()[channel].x_px - static_cast<double>(channel) / 3.0;
        const double channel_px = rig.sheet.channel_offset[channel].value / 3.0;
        const auto c = static_cast<size_t>(colour), r = static_cast<size_t>(row);
        constants.column_nudge[c][r] = 3.0 * nudge_px;
        constants.phase_nudge[c][r] = channel_px * lenses_per_px;
        nudge_rest[c][r] = rests_per_lens * lenses_per_px * (nudge_px + channel_px);
        constants.x_nudge_mm[c][r] = static_cast<float>(rig.panel.pixel_width.value * nudge_px);
      }
    }
    constants.x_step_mm = rig.panel.pixel_width.value / 3.0;
  }

  /// Panel y, in pixels, of a row; rows below the panel, in its last tiles, continue it.
  [[nodiscard]] double y_px(int j) const { return j + cell()[0].y_px; }
  [[nodiscard]] double x_px(int subpixel) const { return subpixel / 3.0; }

  [[nodiscard]] double centre_tan_y(double y_px_at) const {
    const Panel& panel = model.rig().panel;
    const Eye& eye = model.design_eye();
    return std::isinf(eye.z_mm) ? eye.y : (eye.y - panel.y_mm(y_px_at)) / eye.z_mm;
  }

  [[nodiscard]] double ideal_phase(double x, double y) const {
    const Rig& rig = model.rig();
    return ((x - rig.panel.width_px / 2.0) + rig.sheet.slant * (y - rig.panel.height_px / 2.0)) *
               lenses_per_px +
           rig.sheet.offset.value;
  }

  /// The rest of a subpixel that lies in the middle under its lens.
  [[nodiscard]] double middle_rest(double x, double y) const {
    return rests_per_lens *
           (model.phase(x, y, 0, model.design_eye()) - channel_phase(0) - ideal_phase(x, y));
  }
  [[nodiscard]] double channel_phase(size_t channel) const {
    return model.rig().sheet.channel_offset[channel].value / 3.0 * lenses_per_px;
  }

  /// Cuts the range of rests into overlapping pieces, each as wide as a tile can need.
  void set_pieces() {
    const Panel& panel = model.rig().panel;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    constexpr int kGrid = 24;
    for (int a = 0; a <= kGrid; ++a)
      for (int b = 0; b <= kGrid; ++b) {
        const double rest = middle_rest(panel.width_px * (a / double{kGrid}),
                                        panel.height_px * (b / double{kGrid}));
        low = std::min(low, rest);
        high = std::max(high, rest);
      }
    const double tile_share = (columns / 3.0 + kRows) / std::max(1, panel.width_px) +
                              double{kRows} / std::max(1, panel.height_px);
    const double tile_half = 0.55 * rests_per_lens + (high - low) * std::min(1.0, tile_share);
    pieces = std::clamp(static_cast<int>(std::ceil((high - low) / tile_half)), 1, 64);
    piece_width = (high - low) / pieces;
    first_middle = low + piece_width / 2.0;
    piece_half = piece_width / 2.0 + tile_half;
    constants.lens_step = rests_per_lens / piece_half;
    constants.argument_step = constants.lens_step * lenses_per_px / 3.0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t r = 0; r < kRows; ++r)
        constants.argument_nudge[c][r] = nudge_rest[c][r] / piece_half;
  }

  struct RayLaw {
    Polynomial tangent{};
    Polynomial shift_mm{};
  };
  [[nodiscard]] RayLaw law_of(int j, int piece, int count) const {
    const double tan_y = centre_tan_y(y_px(j));
    const double middle = first_middle + piece * piece_width;
    const auto bend = [&](double y) { return model.bend(middle + piece_half * y, tan_y); };
    return {fit(count, [&](double y) { return bend(y).tan_x; }),
            fit(count, [&](double y) { return model.rig().sheet.gap.value * bend(y).shift; })};
  }

  [[nodiscard]] double error_of(int j, int piece, int count) const {
    const RayLaw law = law_of(j, piece, count);
    const double tan_y = centre_tan_y(y_px(j));
    const double middle = first_middle + piece * piece_width;
    const double gap = model.rig().sheet.gap.value;
    double largest = 0.0;
    constexpr int kTrials = 32;
    for (int k = 0; k <= kTrials; ++k) {
      const double y = 2.0 * k / kTrials - 1.0;
      const OpticalModel::Bend exact = model.bend(middle + piece_half * y, tan_y);
      const double tangent = std::abs(value_of(law.tangent, y) - exact.tan_x);
      const double shift = std::abs(value_of(law.shift_mm, y) - gap * exact.shift) / gap;
      largest = std::fmax(largest, std::fmax(tangent, shift));
      if (!std::isfinite(exact.tan_x)) return std::numeric_limits<double>::infinity();
    }
    return largest;
  }

  /// The fewest coefficients that do, tried at the panel's top, middle and bottom.
  [[nodiscard]] bool choose_coefficients() {
    const int height = model.rig().panel.height_px;
    for (int count = 2; count <= kMost; count += 2) {
      double largest = 0.0;
      for (const int j : {0, height / 2, height - 1})
        for (int piece = 0; piece < pieces; ++piece)
          largest = std::fmax(largest, error_of(j, piece, count));
      constants.coefficients = count;
      if (largest <= kTangentTolerance) return true;
    }
    return false;
  }

  void fit_laws() {
    const int bands = (model.rig().panel.height_px + kRows - 1) / kRows;
    laws.resize(static_cast<size_t>(bands) * static_cast<size_t>(pieces));
    for (int band = 0; band < bands; ++band)
      for (int piece = 0; piece < pieces; ++piece)
        for (int row = 0; row < kRows; ++row) {
          const RayLaw law = law_of(band * kRows + row, piece, constants.coefficients);
          BandLaw& out = laws[static_cast<size_t>(band * pieces + piece)];
          for (size_t n = 0; n < kMost; ++n) {
            out.tangent[n][static_cast<size_t>(row)] = static_cast<float>(law.tangent[n]);
            out.shift_mm[n][static_cast<size_t>(row)] = static_cast<float>(law.shift_mm[n]);
          }
        }
  }

  /// How far the parabolas are off between the columns that they go through.
  void measure_phase_error() {
    const Panel& panel = model.rig().panel;
    constexpr int kAcross = 16, kDown = 12;
    double largest = 0.0;
    Tile tile;
    for (int a = 0; a < kAcross; ++a)
      for (int b = 0; b < kDown; ++b) {
        const int bands = (panel.height_px + kRows - 1) / kRows;
        set_phases((bands - 1) * b / (kDown - 1) * kRows,
                   (3 * panel.width_px - columns) * a / (kAcross - 1), tile);
        for (const double part : {0.2, 0.8})
          for (size_t r = 0; r < kRows; ++r) {
            const double c = part * columns;
            const double fitted =
                tile.phase0[r] + c * (tile.phase1[r] + c * tile.phase2[r]) + channel_phase(0);
            const double x = (tile.column_begin - shifts[r] + c) / 3.0;
            const double y = y_px(tile.row_begin + static_cast<int>(r));
            largest =
                std::fmax(largest, std::abs(fitted - model.phase(x, y, 0, model.design_eye())));
          }
      }
    constants.phase_error = 4.0 * largest + 1e-12;
  }

  void set_phases(int row_begin, int column_begin, Tile& out) const {
    out.row_begin = row_begin;
    out.column_begin = column_begin;
    constexpr size_t kPoints = 3 * kRows;
    alignas(64) std::array<double, kPoints> x, y, phase;
    for (size_t r = 0; r < kRows; ++r)
      for (size_t k = 0; k < 3; ++k) {
        x[k * kRows + r] =
            (column_begin - shifts[r] + static_cast<double>(k) * columns / 2.0) / 3.0;
        y[k * kRows + r] = y_px(row_begin + static_cast<int>(r));
      }
    phases.evaluate_points(x, y, phase);
    const double half = columns / 2.0;
    for (size_t r = 0; r < kRows; ++r) {
      const double p0 = phase[r], p1 = phase[kRows + r], p2 = phase[2 * kRows + r];
      out.phase0[r] = p0;
      out.phase2[r] = (p0 - 2.0 * p1 + p2) / (2.0 * half * half);
      out.phase1[r] = (p1 - p0) / half - out.phase2[r] * half;
    }
  }

  [[nodiscard]] bool expand(int row_begin, int column_begin, Tile& out) const {
    set_phases(row_begin, column_begin, out);
    const Panel& panel = model.rig().panel;
    const double gamma = std::isinf(model.design_eye().z_mm)
                             ? 0.0
                             : model.rig().sheet.gap.value / model.design_eye().z_mm;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (size_t r = 0; r < kRows; ++r) {
      const double y = y_px(row_begin + static_cast<int>(r));
      const double x = x_px(column_begin - shifts[r]);
      const double ideal = ideal_phase(x, y);
      const double end_phase = out.phase0[r] + columns * (out.phase1[r] + columns * out.phase2[r]);
      const double at_begin = rests_per_lens * (out.phase0[r] - ideal);
      const double at_end = rests_per_lens * (end_phase - ideal - columns / 3.0 * lenses_per_px);
      low = std::min({low, at_begin, at_end});
      high = std::max({high, at_begin, at_end});
      out.argument0[r] = rests_per_lens * ideal;
      out.x0_mm[r] = panel.x_mm(x);
      out.tan_y[r] = centre_tan_y(y) / (1.0 + gamma);
      out.lens_y_mm[r] = panel.y_mm(y) + model.rig().sheet.gap.value * out.tan_y[r];
    }
    low -= 0.5001 * rests_per_lens;
    high += 0.5001 * rests_per_lens;
    const double wanted = piece_width > 0.0 ? ((low + high) / 2.0 - first_middle) / piece_width : 0;
    if (!(std::abs(wanted) < 1e6)) return false;
    const int piece = std::clamp(static_cast<int>(std::lround(wanted)), 0, pieces - 1);
    const double middle = first_middle + piece * piece_width;
    if (!(low >= middle - piece_half && high <= middle + piece_half)) return false;
    for (double& argument : out.argument0) argument = (argument + middle) / piece_half;
    const BandLaw& law = laws[static_cast<size_t>(row_begin / kRows * pieces + piece)];
    out.tangent = law.tangent;
    out.shift_mm = law.shift_mm;
    return true;
  }

  struct BandLaw {
    std::array<std::array<float, kRows>, kMost> tangent, shift_mm;
  };

  OpticalModel model;
  RowPhaseEvaluator phases;
  int columns;
  std::array<int, kRows> shifts{};
  double lenses_per_px = 0.0;
  double rests_per_lens = 0.0;
  std::array<std::array<double, kRows>, 3> nudge_rest{};
  Constants constants;
  int pieces = 1;
  double piece_width = 0.0;
  double piece_half = 1.0;
  double first_middle = 0.0;
  std::vector<BandLaw> laws;  ///< by band of rows and piece
};

std::unique_ptr<TileOptics> TileOptics::make(const OpticalModel& model, int columns,
                                             std::span<const int, kRows> shifts) {
  LENTICULE_CHECK(columns >= 2);
  if (!serves(model.rig())) return nullptr;
  auto impl = std::make_unique<Impl>(model, columns, shifts);
  impl->set_pieces();
  if (!impl->choose_coefficients()) return nullptr;
  impl->measure_phase_error();
  if (!(impl->constants.phase_error <= kMostPhaseError)) return nullptr;
  impl->fit_laws();
  return std::unique_ptr<TileOptics>(new TileOptics(std::move(impl)));
}

TileOptics::TileOptics(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TileOptics::~TileOptics() = default;

const TileOptics::Constants& TileOptics::constants() const {
  return impl_->constants;
}

bool TileOptics::expand(int row_begin, int column_begin, Tile& out) const {
  return impl_->expand(row_begin, column_begin, out);
}

double TileOptics::exact_lens(const Tile& tile, int column, int row) const {
  const int subpixel = tile.column_begin + column - impl_->shifts[static_cast<size_t>(row)];
  const int channel = (subpixel % 3 + 3) % 3;
  const Vec2 at = impl_->model.rig().panel.subpixel_centre_px(0, 0, channel);
  const double x = (subpixel - channel) / 3 + at.x;
  const double y = tile.row_begin + row + at.y;
  return static_cast<double>(
      split_phase(impl_->model.phase(x, y, channel, impl_->model.design_eye())).lens);
}

}  // namespace lenticule::optics
