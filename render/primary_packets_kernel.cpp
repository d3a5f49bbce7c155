// SPDX-License-Identifier: Apache-2.0
// Sixteen primary rays at a time. The same source gives the same bits for every instruction set.
#include "render/primary_packets_kernel.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using packet_kernel::kLanes;
using packet_kernel::Tile;

constexpr uint32_t kNoGeometry = ~0U;

// Vectors of sixteen lanes; the compiler cuts them into what the instruction set has. They may look
// at arrays of other types.
using Floats = float __attribute__((vector_size(4 * kLanes), may_alias));
using Doubles = double __attribute__((vector_size(8 * kLanes), may_alias));
using Words = uint32_t __attribute__((vector_size(4 * kLanes), may_alias));
using Masks = decltype(Doubles{} > Doubles{});

inline const Doubles& doubles_at(const double* lanes) {
  return *reinterpret_cast<const Doubles*>(lanes);
}
inline const Floats& floats_at(const float* lanes) {
  return *reinterpret_cast<const Floats*>(lanes);
}
inline void store(const Floats& value, float* packet, packet_kernel::Field field) {
  *reinterpret_cast<Floats*>(packet + field * kLanes) = value;
}

/// The lens of every lane: the integer nearest to its phase. Not zero if one lies too near to a
/// border.
inline uint32_t lenses_of(const Tile& t, int column, int colour, Doubles& lens) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: additions round to integers
  const Doubles c = column + doubles_at(t.column_nudge[colour]);
  const Doubles fitted =
      doubles_at(t.phase0) + c * (doubles_at(t.phase1) + c * doubles_at(t.phase2));
  const Doubles phase = fitted + doubles_at(t.phase_nudge[colour]) + t.border_tolerance;
  lens = (phase + kShift) - kShift;
  const Doubles off = phase - lens;
  const Masks unsure = (off > t.safe) | (off < -t.safe);
  long long any = 0;
  for (int r = 0; r < kLanes; ++r) any |= unsure[r];
  return any != 0 ? 1 : 0;
}

inline void arguments_of(const Tile& t, int column, int colour, const Doubles& lens, Floats& out) {
  const Doubles argument =
      lens * t.lens_step -
      ((doubles_at(t.argument0) + doubles_at(t.argument_nudge[colour])) + t.argument_step * column);
  out = __builtin_convertvector(argument, Floats);
}

template <int kCoefficients>
inline void rays_of(const Tile& t, int column, int colour, const Floats& y, float* out) {
  Floats tangent = floats_at(t.tangent + (kCoefficients - 1) * kLanes);
  Floats along = floats_at(t.along + (kCoefficients - 1) * kLanes);
#pragma GCC unroll 8
  for (int n = kCoefficients - 2; n >= 0; --n) {
    tangent = tangent * y + floats_at(t.tangent + n * kLanes);
    along = along * y + floats_at(t.along + n * kLanes);
  }
  const Floats x = along + (t.x_step * static_cast<float>(column) + floats_at(t.x_nudge[colour]));
  store(floats_at(t.origin0_x) + t.across_x * x, out, packet_kernel::kOriginX);
  store(floats_at(t.origin0_y) + t.across_y * x, out, packet_kernel::kOriginY);
  store(floats_at(t.origin0_z) + t.across_z * x, out, packet_kernel::kOriginZ);
  store(floats_at(t.direction0_x) - t.across_x * tangent, out, packet_kernel::kDirectionX);
  store(floats_at(t.direction0_y) - t.across_y * tangent, out, packet_kernel::kDirectionY);
  store(floats_at(t.direction0_z) - t.across_z * tangent, out, packet_kernel::kDirectionZ);
  store(Floats{} + __builtin_inff(), out, packet_kernel::kTFar);
  *reinterpret_cast<Words*>(out + packet_kernel::kGeometry * kLanes) = Words{} + kNoGeometry;
}

inline void rays_of_any(const Tile& t, int column, int colour, const Floats& argument, float* out) {
  switch (t.coefficients) {
    case 2:
      return rays_of<2>(t, column, colour, argument, out);
    case 4:
      return rays_of<4>(t, column, colour, argument, out);
    case 6:
      return rays_of<6>(t, column, colour, argument, out);
    default:
      return rays_of<8>(t, column, colour, argument, out);
  }
}

void make(const Tile& t, int column, int count, float* out, int stride, uint32_t* uncertain) {
  for (int k = 0; k < count; ++k) {
    const int colour = (t.first_colour + column + k) % 3;
    Doubles lens;
    Floats argument;
    uncertain[k] = lenses_of(t, column + k, colour, lens);
    arguments_of(t, column + k, colour, lens, argument);
    rays_of_any(t, column + k, colour, argument, out + k * stride);
  }
}

void make_one(const Tile& t, int column, const double* lenses, float* out) {
  const int colour = (t.first_colour + column) % 3;
  Floats argument;
  arguments_of(t, column, colour, doubles_at(lenses), argument);
  rays_of_any(t, column, colour, argument, out);
}

}  // namespace

extern const packet_kernel::Kernel kPacketKernel;
const packet_kernel::Kernel kPacketKernel{.make = make, .make_one = make_one};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
