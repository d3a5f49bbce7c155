// SPDX-License-Identifier: Apache-2.0
// The inner loops of row_rays.cpp, compiled once per instruction set. Plain data only: this header
// must not bring a shared inline function into a file that is compiled for AVX-512.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::optics::row_kernel {

/// Limits the subpixels per call, so that the intermediate values of a block stay in the L1 cache.
inline constexpr int kBlock = 192;

/// Constants holds one rig in the form that the kernel needs; optics/model.cpp has the derivation.
struct Constants {
  double half_width_px, half_height_px;
  double pixel_width_mm, pixel_height_mm;
  double gap_mm;
  double kappa;          // 1 - nu
  double lenses_per_px;  // 3 / P
  double slant;
  double offset_lenses;
  double lens_per_gap;        // p_h / g
  double slope;               // m a_x / a_y
  double gap_px_x, gap_px_y;  // g / a_x, g / a_y
  double border_tolerance;
  int serve_steps;                         // Newton steps to the served eye
  const double* residual;                  // coefficients of ResidualSpline, or null
  double residual_columns, residual_rows;  // knots
  double knots_per_px_x, knots_per_px_y;
};

/// EyeTerms holds the eye in a form that serves finite and infinite distances: tan = eye - point *
/// inverse_z.
struct EyeTerms {
  double x, y;       // E / Ez, or the tangents of an eye at infinity
  double inverse_z;  // 0 at infinity
  double gamma;      // g / Ez
  int sight_steps;
};

/// Points holds the subpixels of a block: panel points and channel offsets in pixels, arrays of
/// `count`.
struct Points {
  int count;
  const double* x_px;
  const double* y_px;
  const double* channel_px;
};

struct Rays {
  double* lens_x_mm;
  double* lens_y_mm;
  double* tan_x;
  double* tan_y;
  int32_t* lens;
  double* place;
};

using RaysFunction = void (*)(const Constants&, const EyeTerms&, const Points&, const Rays&);
using PhasesFunction = void (*)(const Constants&, const EyeTerms&, const Points&, double* phase);

struct Kernel {
  RaysFunction rays;
  PhasesFunction phases;
};

}  // namespace lenticule::optics::row_kernel

namespace lenticule::optics {
LENTICULE_DECLARE_KERNEL(row_kernel::Kernel, kRowKernel)
}
