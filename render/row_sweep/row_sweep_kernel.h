// SPDX-License-Identifier: Apache-2.0
// The inner loops of the row sweep, compiled once per instruction set. Plain data only: nothing
// here may bring a shared inline function into a file that is compiled for AVX-512.
//
// All rays of one plane are x = x_glass + tan z, in millimetres of the panel frame, z toward the
// viewer. A cell is one ray. Cells lie [place under the lens][lens], so that neighbours in memory
// are rays through neighbouring lenses, nearly parallel.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::render::sweep_kernel {

inline constexpr int kLanes = 16;
inline constexpr int kBlock = 8;  ///< lenses and places are rearranged in squares of this size
inline constexpr int kMostCoefficients = 8;
inline constexpr int kShiftCoefficients = 4;
inline constexpr int kColours = 3;

/// One row of an optics::TileOptics::Tile whose columns are not sheared.
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
  float safe;  ///< the polynomials tell the lens of places no further than this from its middle
};

/// Cells of one plane; rows of `stride` elements, a multiple of kLanes beyond the last lens. Arrays
/// begin at multiples of kLanes elements.
struct Cells {
  float* x;  ///< NaN where a lens has no such place
  float* tan;
  float* z;      ///< of the nearest surface, -infinity where there is none
  float* along;  ///< parameter on the cut
  int32_t* cut;  ///< -1 where there is none
  int lenses;
  int places;  ///< rows
  int stride;
};

/// Of place n: x_glass = x_step k + [x_low, x_high], tan = tan_step k + [tan_low, tan_high] for all
/// lenses k. Arrays are padded to kLanes.
struct Spread {
  float x_step;
  float tan_step;
  float x_far;    ///< the largest magnitude of x_glass
  float tan_far;  ///< and of tan
  float* x_low;
  float* x_high;
  float* tan_low;
  float* tan_high;
};

/// Two stretches of constant z whose convex hull holds what is to be found of a cut.
struct Reach {
  float z[2];
  float x_low[2];
  float x_high[2];
};

/// A triangle's cut: a segment.
struct Segment {
  Reach reach;
  float x0, z0, x1, z1;
};

/// A sphere's, cone's or cylinder's cut. With v = x_glass + tan zc - xc and z = zc + t, it is met
/// where a t^2 + 2 b t + c = 0,
///   a = a0 + tan (a1 + tan a2), b = b0 + b1 tan + v (b2 + b3 tan), c = c0 + v (c1 + v c2),
/// and 0 <= s0 + s1 v + t (s2 + s3 tan) <= height.
struct Conic {
  Reach reach;
  double xc, zc;
  double a0, a1, a2;
  double b0, b1, b2, b3;
  double c0, c1, c2;
  double s0, s1, s2, s3;
  double height;
};

struct Kernel {
  /// Columns [0, count) of a piece, `count` a multiple of kLanes. True if some lens is uncertain.
  bool (*make_rays)(const RowPiece&, int count, float* x, float* tan, int32_t* lens);
  bool (*uncertain)(const RowPiece&, int column);
  void (*make_ray)(const RowPiece&, int column, float off, float* x, float* tan);
  /// From rays in the order of lenses to cells and their spread (steps are given); `first` has the
  /// first ray of each lens, then `stride` times the number of rays; arrays can be read kBlock past
  /// the last place of their last ray. Nothing is seen in any cell then.
  void (*to_cells)(const float* x, const float* tan, const int32_t* first, const Cells&,
                   const Spread&);
  /// Keeps what is nearer (larger z) and behind z = start; cuts are numbered from `number` on.
  void (*segments)(const Cells&, const Spread&, float start, const Segment*, int count,
                   int32_t number);
  void (*conics)(const Cells&, const Spread&, float start, const Conic*, int count, int32_t number);
  /// The way back of what was found; up to kBlock elements after the last ray are written.
  void (*to_rays)(const Cells&, const int32_t* first, float* z, float* along, int32_t* cut);
};

}  // namespace lenticule::render::sweep_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(sweep_kernel::Kernel, kSweepKernel)
}
