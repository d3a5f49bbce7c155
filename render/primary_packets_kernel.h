// SPDX-License-Identifier: Apache-2.0
// The inner loop of primary_packets.cpp, compiled once per instruction set. Plain data only:
// nothing here may bring a shared inline function into a file that is compiled for AVX-512.
#pragma once

#include <cstdint>

namespace lenticule::render::packet_kernel {

inline constexpr int kLanes = 16;

/// Which of Embree's arrays of sixteen, counted from the beginning of a packet, is which. The same
/// in Embree 3 and 4.
enum Field : int {
  kOriginX,
  kOriginY,
  kOriginZ,
  kTNear,
  kDirectionX,
  kDirectionY,
  kDirectionZ,
  kTime,
  kTFar,
  kMask,
  kId,
  kFlags,
  kNormalX,
  kNormalY,
  kNormalZ,
  kU,
  kV,
  kPrimitive,
  kGeometry,
};

/// One tile: optics::TileOptics's numbers, already combined with where rays start and with the map
/// from the panel to the scene. Arrays over the sixteen rows; [3] is the colour of the column.
struct Tile {
  const double *phase0, *phase1, *phase2, *argument0;
  const double *column_nudge[3], *phase_nudge[3], *argument_nudge[3];
  const float* x_nudge[3];
  const float* tangent;  ///< [coefficient][row]
  const float* along;  ///< [coefficient][row]: x where the ray starts, relative to the panel point
  double lens_step, argument_step;
  double border_tolerance;
  double safe;  ///< the polynomials tell the lens of places no further than this from its middle
  float x_step;
  int coefficients;
  int first_colour;  ///< of column 0
  // The ray of row r: origin0 + across * x, direction0 - across * tan_x.
  const float *origin0_x, *origin0_y, *origin0_z;
  const float *direction0_x, *direction0_y, *direction0_z;
  float across_x, across_y, across_z;
};

/// Writes origin, direction, t_far and an empty hit of `count` columns from `column` on; the other
/// fields stay. Packets begin `stride` floats apart. uncertain[k] is not zero where the polynomials
/// cannot tell a lane's lens.
using MakeFunction = void (*)(const Tile&, int column, int count, float* out, int stride,
                              uint32_t* uncertain);
/// The same for one column whose lenses are given.
using MakeOneFunction = void (*)(const Tile&, int column, const double* lenses, float* out);

struct Kernel {
  MakeFunction make;
  MakeOneFunction make_one;
};

}  // namespace lenticule::render::packet_kernel

namespace lenticule::render::isa_baseline {
extern const packet_kernel::Kernel kPacketKernel;
}
namespace lenticule::render::isa_avx2 {
extern const packet_kernel::Kernel kPacketKernel;
}
namespace lenticule::render::isa_avx512 {
extern const packet_kernel::Kernel kPacketKernel;
}
