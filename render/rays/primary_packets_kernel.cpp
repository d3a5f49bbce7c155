// SPDX-License-Identifier: Apache-2.0
// Computes sixteen primary rays at a time. All instruction sets give the same bits.
#include "render/rays/primary_packets_kernel.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using packet_kernel::Field;
using packet_kernel::kLanes;
using packet_kernel::Tile;

constexpr uint32_t kNoGeometry = ~0U;
constexpr int kHalf = kLanes / 2;

// Vectors of sixteen floats and eight doubles; the compiler splits them to the width of the
// instruction set. They may alias arrays of other types. Functions take them by reference only.
using Floats = float __attribute__((vector_size(4 * kLanes), may_alias));
using HalfFloats = float __attribute__((vector_size(4 * kHalf), may_alias));
using Doubles = double __attribute__((vector_size(8 * kHalf), may_alias));
using Words = uint32_t __attribute__((vector_size(4 * kLanes), may_alias));
using Masks = int32_t __attribute__((vector_size(4 * kLanes), may_alias));

inline const Doubles& doubles_at(const double* lanes) {
  return *reinterpret_cast<const Doubles*>(lanes);
}
inline const Floats& floats_at(const float* lanes) {
  return *reinterpret_cast<const Floats*>(lanes);
}
inline void store(const Floats& value, float* packet, Field field) {
  *reinterpret_cast<Floats*>(packet + field * kLanes) = value;
}

/// Computes the distances of eight phases from their nearest integers.
inline void off_of_half(const double (&phase)[3][kLanes], int first, double c, HalfFloats& off) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: additions round to integers
  const Doubles at = doubles_at(&phase[0][first]) +
                     c * (doubles_at(&phase[1][first]) + c * doubles_at(&phase[2][first]));
  const Doubles lens = (at + kShift) - kShift;
  off = __builtin_convertvector(at - lens, HalfFloats);
}

inline void off_of(const Tile& t, int column, int colour, Floats& off) {
  const double c = column;
  HalfFloats low, high;
  off_of_half(t.phase[colour], 0, c, low);
  off_of_half(t.phase[colour], kHalf, c, high);
  off = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}

inline void add_unsure(const Tile& t, const Floats& off, Masks& bad) {
  bad |= off * off > t.safe * t.safe;
}
inline bool any(const Masks& masks) {
  int32_t sum = 0;
  for (int r = 0; r < kLanes; ++r) sum |= masks[r];
  return sum != 0;
}

template <int kCoefficients, bool kParallel>
inline void write_rays(const Tile& t, int column, int colour, const Floats& off, float* out) {
  const auto c = static_cast<float>(column);
  const auto& bend = t.bend[colour];
  const Floats y =
      (floats_at(bend[0]) + c * (floats_at(bend[1]) + c * floats_at(bend[2]))) - t.lens_step * off;
  Floats tangent = floats_at(t.tangent[kCoefficients - 1]);
#pragma GCC unroll 8
  for (int n = kCoefficients - 2; n >= 0; --n) tangent = tangent * y + floats_at(t.tangent[n]);
  Floats shift = floats_at(t.shift[packet_kernel::kShiftCoefficients - 1]);
#pragma GCC unroll 8
  for (int n = packet_kernel::kShiftCoefficients - 2; n >= 0; --n)
    shift = shift * y + floats_at(t.shift[n]);
  const Floats x = floats_at(t.x0[colour]) + ((shift + t.x_step * c) - t.start * tangent);
  if constexpr (kParallel) {
    store(x, out, packet_kernel::kOriginX);
    store(tangent, out, packet_kernel::kDirectionX);
  } else {
    store(floats_at(t.origin0[0]) + t.across[0] * x, out, packet_kernel::kOriginX);
    store(floats_at(t.origin0[1]) + t.across[1] * x, out, packet_kernel::kOriginY);
    store(floats_at(t.origin0[2]) + t.across[2] * x, out, packet_kernel::kOriginZ);
    store(floats_at(t.direction0[0]) + t.across[0] * tangent, out, packet_kernel::kDirectionX);
    store(floats_at(t.direction0[1]) + t.across[1] * tangent, out, packet_kernel::kDirectionY);
    store(floats_at(t.direction0[2]) + t.across[2] * tangent, out, packet_kernel::kDirectionZ);
  }
  store(Floats{} + __builtin_inff(), out, packet_kernel::kTFar);
  *reinterpret_cast<Words*>(out + packet_kernel::kGeometry * kLanes) = Words{} + kNoGeometry;
}

template <int kCoefficients, bool kParallel>
bool make_columns(const Tile& t, int column, int count, float* out, int stride) {
  Masks bad{};
  int colour = (t.first_colour + column) % packet_kernel::kColours;
  for (int k = 0; k < count; ++k) {
    Floats off;
    off_of(t, column + k, colour, off);
    add_unsure(t, off, bad);
    write_rays<kCoefficients, kParallel>(t, column + k, colour, off, out + k * stride);
    colour = colour == packet_kernel::kColours - 1 ? 0 : colour + 1;
  }
  return any(bad);
}

template <bool kParallel>
bool make_any(const Tile& t, int column, int count, float* out, int stride) {
  switch (t.coefficients) {
    case 2:
      return make_columns<2, kParallel>(t, column, count, out, stride);
    case 3:
      return make_columns<3, kParallel>(t, column, count, out, stride);
    case 4:
      return make_columns<4, kParallel>(t, column, count, out, stride);
    case 5:
      return make_columns<5, kParallel>(t, column, count, out, stride);
    case 6:
      return make_columns<6, kParallel>(t, column, count, out, stride);
    case 7:
      return make_columns<7, kParallel>(t, column, count, out, stride);
    default:
      return make_columns<8, kParallel>(t, column, count, out, stride);
  }
}

bool make(const Tile& t, int column, int count, float* out, int stride) {
  return t.parallel ? make_any<true>(t, column, count, out, stride)
                    : make_any<false>(t, column, count, out, stride);
}

bool uncertain(const Tile& t, int column) {
  Floats off;
  off_of(t, column, (t.first_colour + column) % packet_kernel::kColours, off);
  Masks bad{};
  add_unsure(t, off, bad);
  return any(bad);
}

template <bool kParallel>
void make_one_any(const Tile& t, int column, const Floats& off, float* out) {
  const int colour = (t.first_colour + column) % packet_kernel::kColours;
  switch (t.coefficients) {
    case 2:
      return write_rays<2, kParallel>(t, column, colour, off, out);
    case 3:
      return write_rays<3, kParallel>(t, column, colour, off, out);
    case 4:
      return write_rays<4, kParallel>(t, column, colour, off, out);
    case 5:
      return write_rays<5, kParallel>(t, column, colour, off, out);
    case 6:
      return write_rays<6, kParallel>(t, column, colour, off, out);
    case 7:
      return write_rays<7, kParallel>(t, column, colour, off, out);
    default:
      return write_rays<8, kParallel>(t, column, colour, off, out);
  }
}

void make_one(const Tile& t, int column, const float* off, float* out) {
  if (t.parallel)
    make_one_any<true>(t, column, floats_at(off), out);
  else
    make_one_any<false>(t, column, floats_at(off), out);
}

}  // namespace

extern const packet_kernel::Kernel kPacketKernel;
const packet_kernel::Kernel kPacketKernel{
    .make = make, .uncertain = uncertain, .make_one = make_one};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
