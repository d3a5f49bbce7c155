// SPDX-License-Identifier: Apache-2.0
// Inner loops of the row sweep, compiled once per instruction set. Plain data only: this header
// must not bring shared inline functions into a file that is compiled for AVX-512.
//
// All rays of one plane are x = x_panel + tan z, in millimetres of the panel frame, with z toward
// the viewer. A cell is one ray. Cells are ordered [place under the lens][lens], so that neighbours
// in memory are nearly parallel rays through neighbouring lenses.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::sweep_kernel {

inline constexpr int kLanes = 16;
inline constexpr int kBlock = 8;  ///< lenses and places are transposed in squares of this size
inline constexpr int kMostCoefficients = 8;
inline constexpr int kShiftCoefficients = 4;
inline constexpr int kColours = 3;

/// RowPiece is one row of a TileOptics::Tile whose columns are not sheared.
struct RowPiece {
  double phase[kColours][3];
  float bend[kColours][3];
  float x0[kColours];
  float tangent[kMostCoefficients];
  float shift[kShiftCoefficients];
  int coefficients;
  bool colours_alike;
  float lens_step;
  float x_step;
  float safe;  ///< the lens is certain for places no farther than this from its middle
};

/// Cells of one plane in rows of `stride` elements; the stride is a multiple of kLanes beyond the
/// last lens. Arrays begin at multiples of kLanes elements.
struct Cells {
  float* x;  ///< NaN if the lens has no such place
  float* tan;
  float* z;      ///< depth of the nearest surface, -infinity if there is none
  int32_t* cut;  ///< -1 if there is none
  int lenses;
  int places;  ///< number of rows
  int stride;
};

/// Bounds of place n: x_panel = x_step k + [x_low, x_high], tan = tan_step k + [tan_low, tan_high]
/// for all lenses k. Arrays are padded to kLanes.
struct Spread {
  float x_step;
  float tan_step;
  float x_far;    ///< largest magnitude of x_panel
  float tan_far;  ///< largest magnitude of tan
  float* x_low;
  float* x_high;
  float* tan_low;
  float* tan_high;
};

/// Two x ranges at constant z whose convex hull contains the visible part of a cut.
struct Reach {
  float z[2];
  float x_low[2];
  float x_high[2];
};

/// Segment is the cut of a triangle.
struct Segment {
  Reach reach;
  float x0, z0, x1, z1;
};

/// A quadratic form that is zero on a cut: A x^2 + 2 B x z + C z^2 + 2 (gx x + gz z) + f, about
/// (xc, zc).
struct PlaneForm {
  double xc, zc;
  double A, B, C;
  double gx, gz;
  double f;
};

/// Conic is the cut of a sphere, cone or cylinder: the zeros of its form with
/// 0 <= s + s_x x + s_z z <= height.
struct Conic {
  Reach reach;
  PlaneForm form;
  double s, s_x, s_z;
  double height;
};

struct Kernel {
  /// Makes the rays of columns [0, count) of a piece; `count` is a multiple of kLanes. Returns true
  /// if some lens is uncertain.
  bool (*make_rays)(const RowPiece&, int count, float* x, float* tan, int32_t* lens);
  bool (*uncertain)(const RowPiece&, int column);
  void (*make_ray)(const RowPiece&, int column, float off, float* x, float* tan);
  /// Transposes rays in the order of lenses to cells and computes their spread, whose steps are
  /// given; all cells are reset to seeing nothing. `first` holds the first ray of each lens, then
  /// `stride` times the number of rays. Arrays must be readable for kBlock elements past the last
  /// place of their last ray.
  void (*to_cells)(const float* x, const float* tan, const int32_t* first, const Cells&,
                   const Spread&);
  /// Sweep cuts over the cells and keep the nearest points (largest z) behind z = start. Cuts are
  /// numbered starting at `number`.
  void (*segments)(const Cells&, const Spread&, float start, const Segment*, int count,
                   int32_t number);
  void (*conics)(const Cells&, const Spread&, float start, const Conic*, int count, int32_t number);
  /// Transposes the results back to rays; writes up to kBlock elements past the last ray.
  void (*to_rays)(const Cells&, const int32_t* first, float* z, int32_t* cut);
};

}  // namespace lenticule::render::sweep_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(sweep_kernel::Kernel, kSweepKernel)
}
