// SPDX-License-Identifier: Apache-2.0
// The inner loop of primary_packets.cpp, compiled once per instruction set. Plain data only:
// nothing here may bring a shared inline function into a file that is compiled for AVX-512.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "render/accel/packet_fields.h"

namespace lenticule::render::packet_kernel {

inline constexpr int kColours = 3;
inline constexpr int kMostCoefficients = 8;
inline constexpr int kShiftCoefficients = 4;

/// One tile: optics::TileOptics's polynomials, already combined with where rays start. Arrays over
/// the sixteen rows; the colour is the column's. Of column c:
///   phase    = phase[0] + c (phase[1] + c phase[2]), and its lens the nearest integer;
///   argument = bend[0] + c (bend[1] + c bend[2]) - lens_step (phase - lens);
///   tan      = sum of tangent[n] argument^n, per millimetre of depth along the ray;
///   x        = x0 + (x_step c + sum of shift[n] argument^n - start tan), where the ray starts.
struct alignas(64) Tile {
  double phase[kColours][3][kLanes];
  float bend[kColours][3][kLanes];
  float tangent[kMostCoefficients][kLanes];
  float shift[kShiftCoefficients][kLanes];
  float x0[kColours][kLanes];
  /// From the panel to the scene, where their axes are not parallel: the ray of row r is
  /// origin0 + across x, direction0 + across tan.
  float origin0[3][kLanes];
  float direction0[3][kLanes];
  float across[3];
  bool parallel;
  int coefficients;
  int first_colour;  ///< of column 0
  float lens_step;
  float x_step;
  float start;  ///< panel z, mm
  float safe;   ///< the polynomials tell the lens of places no further than this from its middle
};

/// Writes t_far, an empty hit, and origin and direction (their x alone where the axes are parallel:
/// the rest is the same for all columns) of `count` columns from `column` on; the other fields
/// stay. Packets begin `stride` floats apart. True if some lens could not be told: then uncertain()
/// tells which columns.
using MakeFunction = bool (*)(const Tile&, int column, int count, float* out, int stride);
using UncertainFunction = bool (*)(const Tile&, int column);
/// The same for one column, given how far each lane's phase lies from its lens.
using MakeOneFunction = void (*)(const Tile&, int column, const float* off, float* out);

struct Kernel {
  MakeFunction make;
  UncertainFunction uncertain;
  MakeOneFunction make_one;
};

}  // namespace lenticule::render::packet_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(packet_kernel::Kernel, kPacketKernel)
}
