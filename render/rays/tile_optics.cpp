// SPDX-License-Identifier: Apache-2.0
// Two facts make a tile cheap. Along a pixel row the phase seen from the design eye is a straight
// line plus a term that changes over the whole viewing distance: over a few millimetres a parabola
// fits this term to a billionth of a lens. And without a residual map the ray of a subpixel
// depends, in its row, on one number only, the distance `rest` from the panel point to the apex
// line of its lens: one polynomial per row and range of `rest` serves the whole row.
#include "render/rays/tile_optics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/error.h"
#include "optics/row_rays.h"

namespace lenticule::render {
namespace {

constexpr int kMost = TileOptics::kMostCoefficients;
constexpr int kShift = TileOptics::kShiftCoefficients;

/// Error limit of a tangent: half of the resolution of single precision. A subpixel's angular
/// footprint is about 1e-2.
constexpr double kTangentTolerance = 3e-8;
/// Error limit of the lens point in millimetres; single precision has this resolution over a
/// panel's width.
constexpr double kShiftTolerance = 1e-5;
/// Limit of the parabola's phase error; a larger error would send too many subpixels to the exact
/// map.
constexpr double kMostPhaseError = 1e-5;

/// The largest change of `rest` along a tile is divided into this many pieces of the range: narrow
/// pieces need few coefficients.
constexpr int kPiecesPerTileRange = 4;

using Polynomial = std::array<double, kMost>;

double chebyshev_point(int k, int count) { return std::cos(std::numbers::pi * (k + 0.5) / count); }

/// Returns the coefficients, in powers of y in [-1, 1], of the polynomial that takes `values` at
/// the Chebyshev points.
Polynomial fit(int count, const std::array<double, kMost>& values) {
  std::array<double, kMost> chebyshev{};
  for (int k = 0; k < count; ++k)
    for (int n = 0; n < count; ++n)
      chebyshev[static_cast<size_t>(n)] += (n == 0 ? 1.0 : 2.0) / count *
                                           values[static_cast<size_t>(k)] *
                                           std::cos(n * std::numbers::pi * (k + 0.5) / count);
  // Converts T_n to powers of y: T_n+1 = 2 y T_n - T_n-1.
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

/// Returns true if x alone determines the position of a subpixel in its row.
bool serves(const optics::Rig& rig) {
  const optics::SubpixelLayout& layout = rig.panel.layout;
  if (layout.columns() != 1 || layout.rows() != 1 || !rig.sheet.residual.empty()) return false;
  if (!(rig.sheet.gap.value > 0.0)) return false;
  const optics::PixelCell& cell = layout.table().front();
  return cell[0].y_px == cell[1].y_px && cell[1].y_px == cell[2].y_px;
}

}  // namespace

struct TileOptics::Impl : TileOptics::Constants {
  Impl(const optics::OpticalModel& m, int tile_columns, std::span<const int, kRows> tile_shifts)
      : model(m), phases(m, m.design_eye()) {
    columns = tile_columns;
    std::copy(tile_shifts.begin(), tile_shifts.end(), shifts.begin());
    const optics::Rig& rig = model.rig();
    lenses_per_px = 3.0 / rig.sheet.pitch.value;
    rests_per_lens = model.pitch_mm() / rig.sheet.gap.value;
    gamma =
        std::isinf(model.design_eye().z_mm) ? 0.0 : rig.sheet.gap.value / model.design_eye().z_mm;
    for (size_t channel = 0; channel < 3; ++channel) {
      nudge_px[channel] = cell()[channel].x_px - static_cast<double>(channel) / 3.0;
      channel_px[channel] = rig.sheet.channel_offset[channel].value / 3.0;
    }
    const auto alike = [](double a, double b) { return std::abs(a - b) < 1e-12; };
    colours_alike = alike(nudge_px[0], nudge_px[1]) && alike(nudge_px[1], nudge_px[2]) &&
                    alike(channel_px[0], channel_px[1]) && alike(channel_px[1], channel_px[2]);
  }

  [[nodiscard]] const optics::PixelCell& cell() const {
    return model.rig().panel.layout.table().front();
  }

  /// Returns the colour of row r in a column whose colour in row 0 is `colour`.
  [[nodiscard]] size_t channel_of(int colour, size_t r) const {
    return static_cast<size_t>(((colour - shifts[r]) % 3 + 3) % 3);
  }

  /// Returns the panel y, in pixels, of a row; rows of the last tiles below the panel continue the
  /// grid.
  [[nodiscard]] double y_px(int j) const { return j + cell()[0].y_px; }

  [[nodiscard]] double centre_tan_y(double y) const {
    const optics::Eye& eye = model.design_eye();
    return std::isinf(eye.z_mm) ? eye.y : (eye.y - model.rig().panel.y_mm(y)) / eye.z_mm;
  }

  /// Returns the phase of the ideal grating, without a colour's offset.
  [[nodiscard]] double ideal_phase(double x, double y) const {
    const optics::Rig& rig = model.rig();
    return ((x - rig.panel.width_px / 2.0) + rig.sheet.slant * (y - rig.panel.height_px / 2.0)) *
               lenses_per_px +
           rig.sheet.offset.value;
  }
  [[nodiscard]] double exact_phase(double x, double y) const {
    return model.phase(x, y, 0, model.design_eye()) - channel_px[0] * lenses_per_px;
  }

  /// Divides the range of rests into overlapping pieces, so that each tile lies in one piece.
  void set_pieces() {
    const optics::Panel& panel = model.rig().panel;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    constexpr int kGrid = 24;
    for (int a = 0; a <= kGrid; ++a)
      for (int b = 0; b <= kGrid; ++b) {
        const double x = panel.width_px * (a / double{kGrid});
        const double y = panel.height_px * (b / double{kGrid});
        const double rest = rests_per_lens * (exact_phase(x, y) - ideal_phase(x, y));
        low = std::min(low, rest);
        high = std::max(high, rest);
      }
    const double tile_share = (columns / 3.0 + kRows) / std::max(1, panel.width_px) +
                              double{kRows} / std::max(1, panel.height_px);
    const double tile_half = 0.51 * rests_per_lens + (high - low) * std::min(1.0, tile_share);
    pieces = std::clamp(static_cast<int>(std::ceil(kPiecesPerTileRange * (high - low) / tile_half)),
                        1, 256);
    piece_width = (high - low) / pieces;
    first_middle = low + piece_width / 2.0;
    piece_half = piece_width / 2.0 + tile_half;
  }
  [[nodiscard]] double middle(int piece) const { return first_middle + piece * piece_width; }

  struct RayLaw {
    Polynomial tangent{};
    Polynomial shift_mm{};
  };
  [[nodiscard]] RayLaw law_of(double tan_y, int piece, int count) const {
    const double gap = model.rig().sheet.gap.value;
    const auto bend = [&](double y) { return model.bend(middle(piece) + piece_half * y, tan_y); };
    std::array<double, kMost> tangents{}, shifts_mm{};
    for (int k = 0; k < count; ++k)
      tangents[static_cast<size_t>(k)] = bend(chebyshev_point(k, count)).tan_x;
    for (int k = 0; k < kShift; ++k)
      shifts_mm[static_cast<size_t>(k)] = gap * bend(chebyshev_point(k, kShift)).shift;
    return {fit(count, tangents), fit(kShift, shifts_mm)};
  }

  /// Returns the larger of both errors, as multiples of their tolerances, at one height of the
  /// panel.
  [[nodiscard]] double error_of(double tan_y, int piece, const RayLaw& law) const {
    double largest = 0.0;
    constexpr int kTrials = 16;
    for (int k = 0; k <= kTrials; ++k) {
      const double y = 2.0 * k / kTrials - 1.0;
      const optics::OpticalModel::Bend exact = model.bend(middle(piece) + piece_half * y, tan_y);
      const double tangent = std::abs(value_of(law.tangent, y) - exact.tan_x);
      const double shift_mm =
          std::abs(value_of(law.shift_mm, y) - model.rig().sheet.gap.value * exact.shift);
      if (!std::isfinite(exact.tan_x)) return std::numeric_limits<double>::infinity();
      largest = std::max({largest, tangent / kTangentTolerance, shift_mm / kShiftTolerance});
    }
    return largest;
  }

  /// Chooses the fewest coefficients along a row that meet the tolerance, tried at the panel's top,
  /// middle and bottom.
  [[nodiscard]] bool choose_coefficients() {
    const double height = model.rig().panel.height_px;
    for (coefficients = 2; coefficients <= kMost; ++coefficients) {
      double largest = 0.0;
      for (const double y : {0.0, height / 2.0, height})
        for (const int piece : {0, pieces / 2, pieces - 1})
          largest = std::fmax(largest, error_of(centre_tan_y(y), piece,
                                                law_of(centre_tan_y(y), piece, coefficients)));
      if (largest <= 0.7) return true;
    }
    return false;
  }

  /// Fits the coefficients along a row as polynomials of the height, so that the preparation time
  /// does not depend on the number of rows. Uses the fewest coefficients that meet the tolerance
  /// between the fitted heights; returns false if none do.
  [[nodiscard]] bool fit_laws() {
    const double height = model.rig().panel.height_px;
    const double top = centre_tan_y(0.0), bottom = centre_tan_y(height + kRows);
    middle_tan_y = (top + bottom) / 2.0;
    half_tan_y = std::max(std::abs(bottom - top) / 2.0, 1e-9);
    laws.resize(static_cast<size_t>(pieces));
    for (height_coefficients = 2; height_coefficients <= kMost; ++height_coefficients) {
      for (const int piece : {0, pieces / 2, pieces - 1}) fit_law(piece);
      if (error_between_heights() > 1.0) continue;
      for (int piece = 0; piece < pieces; ++piece) fit_law(piece);
      return true;
    }
    return false;
  }

  void fit_law(int piece) {
    std::array<RayLaw, kMost> at;
    for (int k = 0; k < height_coefficients; ++k)
      at[static_cast<size_t>(k)] = law_of(
          middle_tan_y + half_tan_y * chebyshev_point(k, height_coefficients), piece, coefficients);
    PieceLaw& law = laws[static_cast<size_t>(piece)];
    for (size_t n = 0; n < kMost; ++n) {
      std::array<double, kMost> tangents{}, shifts_mm{};
      for (size_t k = 0; k < static_cast<size_t>(height_coefficients); ++k) {
        tangents[k] = at[k].tangent[n];
        shifts_mm[k] = at[k].shift_mm[n];
      }
      law.tangent[n] = fit(height_coefficients, tangents);
      law.shift_mm[n] = fit(height_coefficients, shifts_mm);
    }
  }

  [[nodiscard]] double error_between_heights() const {
    double largest = 0.0;
    for (const double part : {0.0, 0.1, 0.3, 0.5, 0.8, 1.0})
      for (const int piece : {0, pieces / 2, pieces - 1}) {
        const double tan_y = centre_tan_y(part * model.rig().panel.height_px);
        largest = std::fmax(largest, error_of(tan_y, piece, law_at(tan_y, piece)));
      }
    return largest;
  }

  [[nodiscard]] RayLaw law_at(double tan_y, int piece) const {
    const double y = (tan_y - middle_tan_y) / half_tan_y;
    const PieceLaw& law = laws[static_cast<size_t>(piece)];
    RayLaw out;
    for (size_t n = 0; n < kMost; ++n) {
      out.tangent[n] = value_of(law.tangent[n], y);
      out.shift_mm[n] = value_of(law.shift_mm[n], y);
    }
    return out;
  }

  /// Parabola in c through the phases of columns 0, columns / 2 and columns, at x = s / 3 without a
  /// colour's nudge.
  struct Parabola {
    double c0 = 0.0, c1 = 0.0, c2 = 0.0;
    [[nodiscard]] double at(double c) const { return c0 + c * (c1 + c * c2); }
    /// Returns the parabola as a function of c - by.
    [[nodiscard]] Parabola moved(double by) const { return {at(by), c1 + 2.0 * c2 * by, c2}; }
  };
  void fit_phases(int row_begin, int column_begin, std::array<Parabola, kRows>& out) const {
    constexpr size_t kPoints = 3 * kRows;
    std::array<double, kPoints> x, y, phase;
    const double half = columns / 2.0;
    for (size_t r = 0; r < kRows; ++r)
      for (size_t k = 0; k < 3; ++k) {
        x[k * kRows + r] = (column_begin - shifts[r] + static_cast<double>(k) * half) / 3.0;
        y[k * kRows + r] = y_px(row_begin + static_cast<int>(r));
      }
    phases.evaluate_points(x, y, phase);
    for (size_t r = 0; r < kRows; ++r) {
      const double p0 = phase[r], p1 = phase[kRows + r], p2 = phase[2 * kRows + r];
      const double c2 = (p0 - 2.0 * p1 + p2) / (2.0 * half * half);
      out[r] = {p0, (p1 - p0) / half - c2 * half, c2};
    }
  }

  /// Measures the error of the parabolas between the columns that they interpolate.
  void measure_phase_error() {
    const optics::Panel& panel = model.rig().panel;
    constexpr int kAcross = 16, kDown = 12;
    const int bands = (panel.height_px + kRows - 1) / kRows;
    double largest = 0.0;
    std::array<Parabola, kRows> fitted;
    for (int a = 0; a < kAcross; ++a)
      for (int b = 0; b < kDown; ++b) {
        const int row_begin = (bands - 1) * b / (kDown - 1) * kRows;
        const int column_begin = (3 * panel.width_px - columns) * a / (kAcross - 1);
        fit_phases(row_begin, column_begin, fitted);
        for (const double part : {0.2, 0.8})
          for (size_t r = 0; r < kRows; ++r) {
            const double x = (column_begin - shifts[r] + part * columns) / 3.0;
            const double exact = exact_phase(x, y_px(row_begin + static_cast<int>(r)));
            largest = std::fmax(largest, std::abs(fitted[r].at(part * columns) - exact));
          }
      }
    // The distance from the lens is compared in single precision, which adds its rounding error.
    phase_error = 4.0 * largest + 1e-7;
  }

  [[nodiscard]] bool expand(int row_begin, int column_begin, Tile& out) const {
    std::array<Parabola, kRows> fitted;
    fit_phases(row_begin, column_begin, fitted);
    const optics::Panel& panel = model.rig().panel;
    const double gap = model.rig().sheet.gap.value;
    const double ideal_step = lenses_per_px / 3.0;
    std::array<double, kRows> ideal{};
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (size_t r = 0; r < kRows; ++r) {
      const double y = y_px(row_begin + static_cast<int>(r));
      ideal[r] = ideal_phase((column_begin - shifts[r]) / 3.0, y);
      const double at_begin = rests_per_lens * (fitted[r].c0 - ideal[r]);
      const double at_end =
          rests_per_lens * (fitted[r].at(columns) - ideal[r] - columns * ideal_step);
      low = std::min({low, at_begin, at_end});
      high = std::max({high, at_begin, at_end});
      const double tan_y = centre_tan_y(y);
      out.tan_y[r] = tan_y / (1.0 + gamma);
      out.lens_y_mm[r] = panel.y_mm(y) + gap * out.tan_y[r];
    }
    const int piece = piece_for(low - 0.501 * rests_per_lens, high + 0.501 * rests_per_lens);
    if (piece < 0) return false;
    for (size_t colour = 0; colour < 3; ++colour) {
      if (colour > 0 && colours_alike) {
        out.phase[colour] = out.phase[0];
        out.bend[colour] = out.bend[0];
        out.x0_mm[colour] = out.x0_mm[0];
      } else {
        set_colour(column_begin, fitted, ideal, piece, colour, out);
      }
    }
    set_law(row_begin, piece, out);
    out.row_begin = row_begin;
    out.column_begin = column_begin;
    return true;
  }

  void set_colour(int column_begin, const std::array<Parabola, kRows>& fitted,
                  const std::array<double, kRows>& ideal, int piece, size_t colour,
                  Tile& out) const {
    const double scale = 1.0 / piece_half;
    const double ideal_step = lenses_per_px / 3.0;
    for (size_t r = 0; r < kRows; ++r) {
      const size_t channel = channel_of(static_cast<int>(colour), r);
      const Parabola phase = fitted[r].moved(3.0 * nudge_px[channel]);
      // rest of a subpixel in the middle under its lens
      const double rest =
          rests_per_lens * (phase.c0 - ideal[r] - nudge_px[channel] * lenses_per_px);
      out.phase[colour][0][r] =
          phase.c0 + (channel_px[channel] * lenses_per_px + optics::kBorderTolerance);
      out.phase[colour][1][r] = phase.c1;
      out.phase[colour][2][r] = phase.c2;
      out.bend[colour][0][r] = static_cast<float>((rest - middle(piece)) * scale);
      out.bend[colour][1][r] = static_cast<float>(rests_per_lens * (phase.c1 - ideal_step) * scale);
      out.bend[colour][2][r] = static_cast<float>(rests_per_lens * phase.c2 * scale);
      out.x0_mm[colour][r] =
          model.rig().panel.x_mm((column_begin - shifts[r]) / 3.0 + nudge_px[channel]);
    }
  }

  /// Returns the piece that holds [low, high], or -1.
  [[nodiscard]] int piece_for(double low, double high) const {
    const double wanted =
        piece_width > 0.0 ? ((low + high) / 2.0 - first_middle) / piece_width : 0.0;
    if (!(std::abs(wanted) < 1e6)) return -1;
    const int piece = std::clamp(static_cast<int>(std::lround(wanted)), 0, pieces - 1);
    const bool reaches = low >= middle(piece) - piece_half && high <= middle(piece) + piece_half;
    return reaches ? piece : -1;
  }

  void set_law(int row_begin, int piece, Tile& out) const {
    const PieceLaw& law = laws[static_cast<size_t>(piece)];
    std::array<double, kRows> y{};
    for (size_t r = 0; r < kRows; ++r)
      y[r] = (centre_tan_y(y_px(row_begin + static_cast<int>(r))) - middle_tan_y) / half_tan_y;
    const auto set = [&](const Polynomial& over_height, Tile::FloatRows& rows) {
      std::array<double, kRows> value{};
      for (auto n = static_cast<size_t>(height_coefficients); n-- > 0;)
        for (size_t r = 0; r < kRows; ++r) value[r] = value[r] * y[r] + over_height[n];
      for (size_t r = 0; r < kRows; ++r) rows[r] = static_cast<float>(value[r]);
    };
    for (size_t n = 0; n < static_cast<size_t>(coefficients); ++n)
      set(law.tangent[n], out.tangent[n]);
    for (size_t n = 0; n < kShift; ++n) set(law.shift_mm[n], out.shift_mm[n]);
  }

  /// PieceLaw holds each coefficient along a row, in powers of the height.
  struct PieceLaw {
    std::array<Polynomial, kMost> tangent, shift_mm;
  };

  optics::OpticalModel model;
  optics::RowPhaseEvaluator phases;
  std::array<int, kRows> shifts{};
  double lenses_per_px = 0.0;
  double rests_per_lens = 0.0;
  double gamma = 0.0;
  std::array<double, 3> nudge_px{};  ///< x of a subpixel is s / 3 plus the nudge of its colour
  std::array<double, 3> channel_px{};
  int height_coefficients = 2;  ///< number in the height, for each of the coefficients along a row
  int pieces = 1;
  double piece_width = 0.0;
  double piece_half = 1.0;
  double first_middle = 0.0;
  double middle_tan_y = 0.0;
  double half_tan_y = 1.0;
  std::vector<PieceLaw> laws;
};

std::unique_ptr<TileOptics> TileOptics::make(const optics::OpticalModel& model, int columns,
                                             std::span<const int, kRows> shifts) {
  LENTICULE_CHECK(columns >= 2);
  if (!serves(model.rig())) return nullptr;
  auto impl = std::make_unique<Impl>(model, columns, shifts);
  impl->set_pieces();
  if (!impl->choose_coefficients() || !impl->fit_laws()) return nullptr;
  impl->lens_step = impl->rests_per_lens / impl->piece_half;
  impl->x_step_mm = model.rig().panel.pixel_width.value / 3.0;
  impl->measure_phase_error();
  if (!(impl->phase_error <= kMostPhaseError)) return nullptr;
  return std::unique_ptr<TileOptics>(new TileOptics(std::move(impl)));
}

std::unique_ptr<TileOptics> TileOptics::make_first(const optics::OpticalModel& model,
                                                   std::span<const int> widths,
                                                   std::span<const int, kRows> shifts) {
  for (const int columns : widths)
    if (auto made = make(model, columns, shifts)) return made;
  return nullptr;
}

TileOptics::TileOptics(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TileOptics::~TileOptics() = default;

const TileOptics::Constants& TileOptics::constants() const { return *impl_; }

bool TileOptics::expand(int row_begin, int column_begin, Tile& out) const {
  return impl_->expand(row_begin, column_begin, out);
}

double TileOptics::exact_off(const Tile& tile, int column, int row) const {
  const int subpixel = tile.column_begin + column - impl_->shifts[static_cast<size_t>(row)];
  const int channel = (subpixel % 3 + 3) % 3;
  const optics::SubpixelOffset& at = impl_->cell()[static_cast<size_t>(channel)];
  const double x = (subpixel - channel) / 3 + at.x_px;
  const double phase =
      impl_->model.phase(x, tile.row_begin + row + at.y_px, channel, impl_->model.design_eye());
  return phase - static_cast<double>(optics::split_phase(phase).lens);
}

}  // namespace lenticule::render
