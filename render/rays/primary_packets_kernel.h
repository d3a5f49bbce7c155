// SPDX-License-Identifier: Apache-2.0
// Inner loop of primary_packets.cpp, compiled once per instruction set. Plain data only: this
// header must not bring shared inline functions into a file that is compiled for AVX-512.
#pragma once

#include <cstdint>

#include "base/cpu.h"
#include "render/accel/packet_fields.h"

namespace lenticule::render::packet_kernel {

inline constexpr int kColours = 3;
inline constexpr int kMostCoefficients = 8;
inline constexpr int kShiftCoefficients = 4;

/// Tile holds the polynomials of TileOptics for one tile, already combined with the start
/// of the rays. Arrays run over the sixteen rows; the colour is the column's. For column c:
///   phase    = phase[0] + c (phase[1] + c phase[2]); its lens is the nearest integer;
///   argument = bend[0] + c (bend[1] + c bend[2]) - lens_step (phase - lens);
///   tan      = sum of tangent[n] argument^n, per millimetre of depth along the ray;
///   x        = x0 + (x_step c + sum of shift[n] argument^n - start tan), at the start of the ray.
struct alignas(64) Tile {
  double phase[kColours][3][kLanes];
  float bend[kColours][3][kLanes];
  float tangent[kMostCoefficients][kLanes];
  float shift[kShiftCoefficients][kLanes];
  float x0[kColours][kLanes];
  /// Map from the panel to the scene: the ray of row r is origin0 + across x, direction0 + across
  /// tan.
  float origin0[3][kLanes];
  float direction0[3][kLanes];
  float across[3];
  int coefficients;
  int first_colour;  ///< colour of column 0
  float lens_step;
  float x_step;
  float start;  ///< panel z, mm
  float safe;   ///< the lens is certain for places no farther than this from its middle
};

struct Kernel {
  /// Writes t_far, an empty hit, origin and direction of `count` columns starting at `column`. All
  /// other fields keep their values. Packets begin `stride` floats apart. Returns true if the lens
  /// of some ray is uncertain; uncertain() then identifies the columns.
  bool (*make)(const Tile&, int column, int count, float* out, int stride);
  bool (*uncertain)(const Tile&, int column);
  /// Makes one column, given the distance of each lane's phase from its lens.
  void (*make_one)(const Tile&, int column, const float* off, float* out);
};

}  // namespace lenticule::render::packet_kernel

namespace lenticule::render {
LENTICULE_DECLARE_KERNEL(packet_kernel::Kernel, kPacketKernel)
}
