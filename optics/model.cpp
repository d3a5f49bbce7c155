// SPDX-License-Identifier: Apache-2.0
// Evaluates the optical model one subpixel at a time; each equation is iterated until its solution
// no longer changes.
//
// In this file, lengths along z are in units of the eye's distance: with t = (E - Q) / Ez the
// tangents of the direction from a panel point to the eye, gamma = g / Ez and s = sqrt(1 + (1 - nu)
// |r / Ez|^2), the law of the sheet becomes Delta = g t / (s + gamma). An eye at infinity has gamma
// = 0, and t is given.
#include "optics/model.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"

namespace lenticule::optics {
namespace {

using Cubic = std::array<double, 4>;

/// Returns the Catmull-Rom segment between b and c, by powers of its parameter.
Cubic catmull_rom(double a, double b, double c, double d) {
  return {b, 0.5 * (c - a), a - 2.5 * b + 2.0 * c - 0.5 * d, 0.5 * (d - a) + 1.5 * (b - c)};
}

/// Returns knot `index` of a line of `count` knots, extrapolated in a straight line on both sides.
double extended(auto knot, int count, int index) {
  if (index >= 0 && index < count) return knot(index);
  const int last = count - 1;
  if (last == 0) return knot(0);
  return index < 0 ? knot(0) + index * (knot(1) - knot(0))
                   : knot(last) + (index - last) * (knot(last) - knot(last - 1));
}

double knot(const ResidualMap& map, int column, int row) {
  return extended(
      [&](int r) {
        return extended([&](int c) { return map.lenses[static_cast<size_t>(r * map.columns + c)]; },
                        map.columns, column);
      },
      map.rows, row);
}

void append_cell(const ResidualMap& map, int column, int row, std::vector<double>& out) {
  std::array<Cubic, 4> along_x;
  for (int i = 0; i < 4; ++i) {
    const int r = row + i - 1;
    along_x[static_cast<size_t>(i)] =
        catmull_rom(knot(map, column - 1, r), knot(map, column, r), knot(map, column + 1, r),
                    knot(map, column + 2, r));
  }
  std::array<double, 16> cell{};
  for (size_t q = 0; q < 4; ++q) {
    const Cubic down = catmull_rom(along_x[0][q], along_x[1][q], along_x[2][q], along_x[3][q]);
    for (size_t p = 0; p < 4; ++p) cell[4 * p + q] = down[p];
  }
  out.insert(out.end(), cell.begin(), cell.end());
}

struct Place {
  int cell;
  double inside;
};
Place locate(double grid, int count) {
  const double cell = std::clamp(std::floor(grid), -1.0, count - 1.0);
  return {static_cast<int>(cell), grid - cell};
}

// Newton's method at least squares the error per step, so a valid rig never needs all these steps.
constexpr int kMaxNewtonSteps = 60;
constexpr double kConverged = 1e-15;

/// Sight is the direction from a panel point to an eye.
struct Sight {
  double tan_x;
  double tan_y;
  double gamma;
};

Sight sight(Vec2 point_mm, const Eye& eye, double gap_mm) {
  if (std::isinf(eye.z_mm)) return {eye.x, eye.y, 0.0};
  return {(eye.x - point_mm.x) / eye.z_mm, (eye.y - point_mm.y) / eye.z_mm, gap_mm / eye.z_mm};
}

/// Returns s for a given panel point: s^2 = 1 + kappa |t|^2 (s / (s + gamma))^2, which lies between
/// 1 and sqrt(1 + kappa |t|^2). For an eye much nearer than the sheet is thick, Newton steps alone
/// would leave these bounds and converge to another root.
double obliquity(const Sight& to_eye, double kappa) {
  constexpr double kSlack = 1e-9;  // tolerance for rounding at the root
  const double a = kappa * (to_eye.tan_x * to_eye.tan_x + to_eye.tan_y * to_eye.tan_y);
  const double gamma = to_eye.gamma;
  double s = std::sqrt(1.0 + a / ((1.0 + gamma) * (1.0 + gamma)));
  double low = 1.0;
  double high = std::sqrt(1.0 + a);
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const double d = 1.0 / (s + gamma), h = s * d;
    const double missing = s * s - 1.0 - a * h * h;
    (missing < 0.0 ? low : high) = s;
    double step = missing / (2.0 * (s - a * h * gamma * d * d));
    const double next = s - step;
    if (!(next >= low * (1.0 - kSlack) && next <= high * (1.0 + kSlack)))
      step = s - 0.5 * (low + high);
    s -= step;
    if (!(std::abs(step) > kConverged * s)) break;
  }
  return s;
}

/// Search holds the inputs of the search for the point on the viewing line that sees a subpixel
/// through the subpixel's lens. Shifts are Delta / g.
struct Search {
  double tan_y;
  double gamma;
  double kappa;
  double slope;          ///< tan of the slant angle on the panel
  double lens_per_gap;   ///< p_h / g
  double shift_at_rest;  ///< x shift onto the lens's axis without y shift and residual
  double first_shift;  ///< start of the search: a pitch times the place away from the shift to the
                       ///< centre
};
struct ServedEye {
  double shift;  ///< Delta_x / g
  double s;
};

/// Solves lambda(L) = lens together with the law of the sheet,
///   F(s) = s^2 (1 - kappa shift^2) - 1 - kappa (t_y s / (s + gamma))^2 = 0.
/// Each step linearises the residual map around the present L and makes a Newton step of F.
ServedEye find_served_eye(const Search& q, double s, const auto& residual) {
  double shift = q.first_shift;
  const double eye_tan_y = q.tan_y * s / (s + q.gamma);
  s = std::sqrt((1.0 + q.kappa * eye_tan_y * eye_tan_y) / (1.0 - q.kappa * shift * shift));
  for (int i = 0; i < kMaxNewtonSteps; ++i) {
    const double d = 1.0 / (s + q.gamma), h = s * d;
    const ResidualSpline::Value bend = residual(shift, q.tan_y * d);
    const double stretch = 1.0 + q.lens_per_gap * bend.per_px_x;
    const double before = shift;
    shift = (q.shift_at_rest + q.slope * q.tan_y * d -
             q.lens_per_gap * (bend.lenses - bend.per_px_x * before)) /
            stretch;
    const double shift_per_s = -q.slope * q.tan_y * d * d / stretch;
    const double room = 1.0 - q.kappa * shift * shift;
    const double ky = q.kappa * q.tan_y * q.tan_y * h;
    const double f = s * s * room - 1.0 - ky * h;
    const double df =
        2.0 * (s * room - q.kappa * s * s * shift * shift_per_s - ky * q.gamma * d * d);
    const double step = f / df;
    s -= step;
    if (!(std::abs(step) + std::abs(shift - before) > kConverged)) break;
  }
  return {shift, s};
}

}  // namespace

ResidualSpline::ResidualSpline(const ResidualMap& map, int width_px, int height_px) {
  if (map.empty()) return;
  columns_ = map.columns;
  rows_ = map.rows;
  knots_per_px_x_ = (columns_ - 1.0) / width_px;
  knots_per_px_y_ = (rows_ - 1.0) / height_px;
  coefficients_.reserve(static_cast<size_t>((columns_ + 1) * (rows_ + 1)) * 16);
  for (int row = -1; row < rows_; ++row)
    for (int column = -1; column < columns_; ++column) append_cell(map, column, row, coefficients_);
}

ResidualSpline::Value ResidualSpline::at(double x_px, double y_px) const {
  if (empty()) return {};
  const Place x = locate(x_px * knots_per_px_x_, columns_);
  const Place y = locate(y_px * knots_per_px_y_, rows_);
  const double* cell =
      &coefficients_[static_cast<size_t>((y.cell + 1) * (columns_ + 1) + x.cell + 1) * 16];
  const auto power = [&](int q) {
    const double u = y.inside;
    return ((cell[12 + q] * u + cell[8 + q]) * u + cell[4 + q]) * u + cell[q];
  };
  const double c0 = power(0), c1 = power(1), c2 = power(2), c3 = power(3), t = x.inside;
  return {.lenses = ((c3 * t + c2) * t + c1) * t + c0,
          .per_px_x = ((3.0 * c3 * t + 2.0 * c2) * t + c1) * knots_per_px_x_};
}

struct OpticalModel::Prepared {
  explicit Prepared(const Rig& source)
      : rig(source),
        residual(source.sheet.residual, source.panel.width_px, source.panel.height_px) {}

  Rig rig;
  ResidualSpline residual;
};

LensPlace split_phase(double phase) {
  const double shifted = phase + kBorderTolerance;
  double lens = std::floor(shifted);
  if (shifted - lens >= 0.5) lens += 1.0;
  return {static_cast<int64_t>(lens), std::max(phase - lens, -0.5)};
}

OpticalModel::OpticalModel(const Rig& rig) {
  validate_rig(rig, rig.name.empty() ? "rig" : rig.name);
  prepared_ = std::make_shared<const Prepared>(rig);
  const auto& [height, distance, centre] = rig.viewing;
  if (std::isinf(distance.value))
    design_eye_ = {0.0, 0.0, distance.value};
  else
    design_eye_ = {centre.value, height.value, distance.value};
}

const Rig& OpticalModel::rig() const { return prepared_->rig; }

const ResidualSpline& OpticalModel::residual() const { return prepared_->residual; }

double OpticalModel::lens_coordinate(double x_px, double y_px, int channel) const {
  const Panel& panel = rig().panel;
  const LensSheet& sheet = rig().sheet;
  const double x = x_px + sheet.channel_offset[static_cast<size_t>(channel)].value / 3.0;
  const double from_centre =
      (x - panel.width_px / 2.0) + sheet.slant * (y_px - panel.height_px / 2.0);
  return 3.0 * from_centre / sheet.pitch.value + sheet.offset.value + residual().at(x, y_px).lenses;
}

Vec2 OpticalModel::refraction_shift_mm(Vec2 lens_point_mm, const Eye& eye) const {
  const LensSheet& sheet = rig().sheet;
  const Sight r = sight(lens_point_mm, eye, sheet.gap.value);
  const double kappa = 1.0 - sheet.refraction_shape;
  const double scale =
      sheet.gap.value / std::sqrt(1.0 + kappa * (r.tan_x * r.tan_x + r.tan_y * r.tan_y));
  return {r.tan_x * scale, r.tan_y * scale};
}

Vec2 OpticalModel::lens_point_mm(Vec2 panel_point_mm, const Eye& eye) const {
  const LensSheet& sheet = rig().sheet;
  const Sight to_eye = sight(panel_point_mm, eye, sheet.gap.value);
  const double scale =
      sheet.gap.value / (obliquity(to_eye, 1.0 - sheet.refraction_shape) + to_eye.gamma);
  return panel_point_mm + Vec2{to_eye.tan_x, to_eye.tan_y} * scale;
}

double OpticalModel::phase(double x_px, double y_px, int channel, const Eye& eye) const {
  const Panel& panel = rig().panel;
  const Vec2 q{panel.x_mm(x_px), panel.y_mm(y_px)};
  const Vec2 delta = lens_point_mm(q, eye) - q;
  return lens_coordinate(x_px + delta.x / panel.pixel_width.value,
                         y_px - delta.y / panel.pixel_height.value, channel);
}

SubpixelRay OpticalModel::ray(int i, int j, int channel) const {
  const Panel& panel = rig().panel;
  const LensSheet& sheet = rig().sheet;
  const double gap = sheet.gap.value, kappa = 1.0 - sheet.refraction_shape;
  const Vec2 at_px = panel.subpixel_centre_px(i, j, channel);
  const Vec2 at_mm{panel.x_mm(at_px.x), panel.y_mm(at_px.y)};
  const Sight to_centre = sight(at_mm, design_eye_, gap);
  const LensPlace served = split_phase(phase(at_px.x, at_px.y, channel, design_eye_));

  const double channel_px = sheet.channel_offset[static_cast<size_t>(channel)].value / 3.0;
  const double gap_px_x = gap / panel.pixel_width.value;
  const double gap_px_y = gap / panel.pixel_height.value;
  const auto residual = [&](double shift_x, double shift_y) {
    ResidualSpline::Value value = prepared_->residual.at(at_px.x + channel_px + shift_x * gap_px_x,
                                                         at_px.y - shift_y * gap_px_y);
    value.per_px_x *= gap_px_x;  // now per unit of shift
    return value;
  };
  const double from_centre = (at_px.x + channel_px - panel.width_px / 2.0) +
                             sheet.slant * (at_px.y - panel.height_px / 2.0);
  const double ideal_phase = 3.0 * from_centre / sheet.pitch.value + sheet.offset.value;
  const double lens_per_gap = pitch_mm() / gap;
  const double s_centre = obliquity(to_centre, kappa);
  const ServedEye eye = find_served_eye(
      {.tan_y = to_centre.tan_y,
       .gamma = to_centre.gamma,
       .kappa = kappa,
       .slope = sheet.slant * panel.pixel_width.value / panel.pixel_height.value,
       .lens_per_gap = lens_per_gap,
       .shift_at_rest = lens_per_gap * (static_cast<double>(served.lens) - ideal_phase),
       .first_shift = to_centre.tan_x / (s_centre + to_centre.gamma) - lens_per_gap * served.place},
      s_centre, residual);

  const double paraxial_tan_y = to_centre.tan_y / (1.0 + to_centre.gamma);
  return {.lens_x_mm = at_mm.x + gap * eye.shift,
          .lens_y_mm = at_mm.y + gap * paraxial_tan_y,
          .tan_x = eye.shift * eye.s,
          .tan_y = paraxial_tan_y,
          .lens = served.lens,
          .place = served.place};
}

OpticalModel::Bend OpticalModel::bend(double rest, double tan_y) const {
  const Panel& panel = rig().panel;
  const LensSheet& sheet = rig().sheet;
  LENTICULE_CHECK(residual().empty());
  const double gamma = std::isinf(design_eye_.z_mm) ? 0.0 : sheet.gap.value / design_eye_.z_mm;
  const ServedEye eye =
      find_served_eye({.tan_y = tan_y,
                       .gamma = gamma,
                       .kappa = 1.0 - sheet.refraction_shape,
                       .slope = sheet.slant * panel.pixel_width.value / panel.pixel_height.value,
                       .lens_per_gap = pitch_mm() / sheet.gap.value,
                       .shift_at_rest = rest,
                       .first_shift = rest},
                      1.0, [](double, double) { return ResidualSpline::Value{}; });
  return {eye.shift, eye.shift * eye.s};
}

double OpticalModel::pitch_mm() const {
  return rig().sheet.pitch.value * rig().panel.pixel_width.value / 3.0;
}

double OpticalModel::lobe_width_mm(double z_mm) const {
  return pitch_mm() * z_mm / rig().sheet.gap.value;
}

double OpticalModel::depth_of_field_mm() const {
  return rig().sheet.gap.value * rig().sheet.pitch.value;
}

}  // namespace lenticule::optics
