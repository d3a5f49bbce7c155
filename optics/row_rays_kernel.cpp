// SPDX-License-Identifier: Apache-2.0
// Evaluates the subpixel-to-ray map over a block of subpixels: the equations of model.cpp as plain
// loops over arrays, which the compiler vectorises, with a fixed number of Newton steps and no
// branch. The same source gives the same bits for every instruction set: additions and
// multiplications are never contracted or reordered, and division and square root are correctly
// rounded everywhere.
#include "optics/row_rays_kernel.h"

namespace lenticule::optics::LENTICULE_ISA_NAMESPACE {
namespace {

using row_kernel::Constants;
using row_kernel::EyeTerms;
using row_kernel::kBlock;
using row_kernel::Points;
using row_kernel::Rays;

struct alignas(64) Lane {
  double value[kBlock];
  double& operator[](int i) { return value[i]; }
  double operator[](int i) const { return value[i]; }
};

/// Returns the nearest integer of |v| < 2^51, ties to even, in two additions, which vectorise on
/// every machine.
inline double nearest(double v) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52
  return (v + kShift) - kShift;
}

struct Sight {
  Lane tan_x, tan_y, s;
};

void look(const EyeTerms& eye, const Constants& c, const Points& p, Sight& out) {
  const double paraxial = 1.0 / ((1.0 + eye.gamma) * (1.0 + eye.gamma));
  for (int i = 0; i < p.count; ++i) {
    const double tx = eye.x - c.pixel_width_mm * (p.x_px[i] - c.half_width_px) * eye.inverse_z;
    const double ty = eye.y - c.pixel_height_mm * (c.half_height_px - p.y_px[i]) * eye.inverse_z;
    out.tan_x[i] = tx;
    out.tan_y[i] = ty;
    out.s[i] = __builtin_sqrt(1.0 + c.kappa * (tx * tx + ty * ty) * paraxial);
  }
  for (int step = 0; step < eye.sight_steps; ++step) {
    for (int i = 0; i < p.count; ++i) {
      const double tx = out.tan_x[i], ty = out.tan_y[i], s = out.s[i];
      const double a = c.kappa * (tx * tx + ty * ty);
      const double d = 1.0 / (s + eye.gamma), h = s * d;
      out.s[i] = s - (s * s - 1.0 - a * h * h) / (2.0 * (s - a * h * eye.gamma * d * d));
    }
  }
}

/// Computes value and x derivative of one bicubic polynomial at t, u.
inline void bicubic(const double* k, double t, double u, double& value, double& slope) {
  const double c0 = ((k[12] * u + k[8]) * u + k[4]) * u + k[0];
  const double c1 = ((k[13] * u + k[9]) * u + k[5]) * u + k[1];
  const double c2 = ((k[14] * u + k[10]) * u + k[6]) * u + k[2];
  const double c3 = ((k[15] * u + k[11]) * u + k[7]) * u + k[3];
  value = ((c3 * t + c2) * t + c1) * t + c0;
  slope = (3.0 * c3 * t + 2.0 * c2) * t + c1;
}

/// Evaluates the spline; `cell_of(i)` gives the coefficients of point i.
inline void spline(const Constants& c, const auto& cell_of, int count, const Lane& t, const Lane& u,
                   Lane& lenses, Lane& per_px_x) {
  for (int i = 0; i < count; ++i) {
    double value, slope;
    bicubic(cell_of(i), t[i], u[i], value, slope);
    lenses[i] = value;
    per_px_x[i] = slope * c.knots_per_px_x;
  }
}

/// Computes the residual map and its derivative along x at count points, in pixels. Overwrites the
/// points with their coordinates inside their cells.
void residual_at(const Constants& c, int count, Lane& x, Lane& y, Lane& lenses, Lane& per_px_x) {
  const int stride = static_cast<int>(c.residual_columns) + 1;
  const double last_column = c.residual_columns - 1.0, last_row = c.residual_rows - 1.0;
  if (count <= 0) return;
  alignas(64) int32_t cell[kBlock];
  for (int i = 0; i < count; ++i) {
    const double gx = x[i] * c.knots_per_px_x, gy = y[i] * c.knots_per_px_y;
    double column = nearest(gx - 0.5), row = nearest(gy - 0.5);
    column = column > -1.0 ? column : -1.0;
    column = column < last_column ? column : last_column;
    row = row > -1.0 ? row : -1.0;
    row = row < last_row ? row : last_row;
    x[i] = gx - column;
    y[i] = gy - row;
    cell[i] = 16 * ((static_cast<int32_t>(row) + 1) * stride + static_cast<int32_t>(column) + 1);
  }
  int different = 0;
  for (int i = 0; i < count; ++i) different |= cell[i] ^ cell[0];
  if (different != 0)
    return spline(
        c, [&](int i) { return c.residual + cell[i]; }, count, x, y, lenses, per_px_x);
  // Most blocks lie in one cell, which needs no gathers.
  double k[16];
  for (int n = 0; n < 16; ++n) k[n] = c.residual[cell[0] + n];
  spline(
      c, [&](int) { return k; }, count, x, y, lenses, per_px_x);
}

/// Computes Phi_E(Q) of every point.
void phases_of(const Constants& c, const EyeTerms& eye, const Points& p, const Sight& sight,
               double* phase) {
  Lane lens_x, lens_y;
  for (int i = 0; i < p.count; ++i) {
    const double d = 1.0 / (sight.s[i] + eye.gamma);
    const double x = p.x_px[i] + p.channel_px[i] + c.gap_px_x * sight.tan_x[i] * d;
    const double y = p.y_px[i] - c.gap_px_y * sight.tan_y[i] * d;
    lens_x[i] = x;
    lens_y[i] = y;
    phase[i] = ((x - c.half_width_px) + c.slant * (y - c.half_height_px)) * c.lenses_per_px +
               c.offset_lenses;
  }
  if (c.residual == nullptr) return;
  Lane lenses, per_px_x;
  residual_at(c, p.count, lens_x, lens_y, lenses, per_px_x);
  for (int i = 0; i < p.count; ++i) phase[i] += lenses[i];
}

/// Chooses the lens that serves the viewing line and the place under the lens, by the rule of
/// split_phase.
void choose_lens(const Constants& c, int count, const Lane& phase, Lane& lens, const Rays& out) {
  for (int i = 0; i < count; ++i) {
    const double shifted = phase[i] + c.border_tolerance;
    const double even = nearest(shifted);
    const double k = shifted - even >= 0.5 ? even + 1.0 : even;
    const double place = phase[i] - k;
    lens[i] = k;
    out.lens[i] = static_cast<int32_t>(k);
    out.place[i] = place > -0.5 ? place : -0.5;
  }
}

struct Search {
  Lane at_rest, shift, s, bend, bend_per_shift;
};

void start_search(const Constants& c, const EyeTerms& eye, const Points& p, const Sight& sight,
                  const Lane& lens, const double* place, Search& q) {
  for (int i = 0; i < p.count; ++i) {
    const double ideal_phase = ((p.x_px[i] + p.channel_px[i] - c.half_width_px) +
                                c.slant * (p.y_px[i] - c.half_height_px)) *
                                   c.lenses_per_px +
                               c.offset_lenses;
    const double at_rest = c.lens_per_gap * (lens[i] - ideal_phase);
    const double d = 1.0 / (sight.s[i] + eye.gamma), ty = sight.tan_y[i];
    const double shift = sight.tan_x[i] * d - c.lens_per_gap * place[i];
    const double eye_ty = ty * sight.s[i] * d;
    q.at_rest[i] = at_rest;
    q.shift[i] = shift;
    q.s[i] = __builtin_sqrt((1.0 + c.kappa * eye_ty * eye_ty) / (1.0 - c.kappa * shift * shift));
  }
}

/// Linearises the residual map at the present lens points as a function of the shift: bend +
/// bend_per_shift * shift, in units of the shift.
void bend_of_residual(const Constants& c, const EyeTerms& eye, const Points& p, const Sight& sight,
                      Search& q) {
  Lane lens_x, lens_y, lenses, per_px_x;
  for (int i = 0; i < p.count; ++i) {
    const double d = 1.0 / (q.s[i] + eye.gamma);
    lens_x[i] = p.x_px[i] + p.channel_px[i] + c.gap_px_x * q.shift[i];
    lens_y[i] = p.y_px[i] - c.gap_px_y * sight.tan_y[i] * d;
  }
  residual_at(c, p.count, lens_x, lens_y, lenses, per_px_x);
  for (int i = 0; i < p.count; ++i) {
    const double per_shift = c.lens_per_gap * per_px_x[i] * c.gap_px_x;
    q.bend[i] = c.lens_per_gap * lenses[i] - per_shift * q.shift[i];
    q.bend_per_shift[i] = per_shift;
  }
}

/// Does a Newton step. For a perfect grating, without a residual, there is no division.
template <bool kHasResidual>
void search_step(const Constants& c, const EyeTerms& eye, int count, const Sight& sight,
                 Search& q) {
  for (int i = 0; i < count; ++i) {
    const double s = q.s[i], ty = sight.tan_y[i];
    const double d = 1.0 / (s + eye.gamma), h = s * d;
    double shift = q.at_rest[i] + c.slope * ty * d;
    double shift_per_s = -c.slope * ty * d * d;
    if constexpr (kHasResidual) {
      const double stretch = 1.0 / (1.0 + q.bend_per_shift[i]);
      shift = (shift - q.bend[i]) * stretch;
      shift_per_s = shift_per_s * stretch;
    }
    const double room = 1.0 - c.kappa * shift * shift;
    const double ky = c.kappa * ty * ty * h;
    const double f = s * s * room - 1.0 - ky * h;
    const double df =
        2.0 * (s * room - c.kappa * s * s * shift * shift_per_s - ky * eye.gamma * d * d);
    q.shift[i] = shift;
    q.s[i] = s - f / df;
  }
}

void write_rays(const Constants& c, const EyeTerms& eye, const Points& p, const Sight& sight,
                const Search& q, const Rays& out) {
  const double paraxial = 1.0 / (1.0 + eye.gamma);
  for (int i = 0; i < p.count; ++i) {
    const double tan_y = sight.tan_y[i] * paraxial;
    out.lens_x_mm[i] = c.pixel_width_mm * (p.x_px[i] - c.half_width_px) + c.gap_mm * q.shift[i];
    out.lens_y_mm[i] = c.pixel_height_mm * (c.half_height_px - p.y_px[i]) + c.gap_mm * tan_y;
    out.tan_x[i] = q.shift[i] * q.s[i];
    out.tan_y[i] = tan_y;
  }
}

void rays(const Constants& c, const EyeTerms& eye, const Points& p, const Rays& out) {
  Sight sight;
  Lane phase, lens;
  Search search;
  look(eye, c, p, sight);
  phases_of(c, eye, p, sight, phase.value);
  choose_lens(c, p.count, phase, lens, out);
  start_search(c, eye, p, sight, lens, out.place, search);
  for (int step = 0; step < c.serve_steps; ++step) {
    if (c.residual != nullptr) {
      bend_of_residual(c, eye, p, sight, search);
      search_step<true>(c, eye, p.count, sight, search);
    } else {
      search_step<false>(c, eye, p.count, sight, search);
    }
  }
  write_rays(c, eye, p, sight, search, out);
}

void phases(const Constants& c, const EyeTerms& eye, const Points& p, double* phase) {
  Sight sight;
  look(eye, c, p, sight);
  phases_of(c, eye, p, sight, phase);
}

}  // namespace

extern const row_kernel::Kernel kRowKernel;
const row_kernel::Kernel kRowKernel{.rays = rays, .phases = phases};

}  // namespace lenticule::optics::LENTICULE_ISA_NAMESPACE
