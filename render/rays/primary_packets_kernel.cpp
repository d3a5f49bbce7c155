// SPDX-License-Identifier: Apache-2.0
// Computes sixteen primary rays at a time. All instruction sets give the same bits.
#include "render/rays/primary_packets_kernel.h"

#include "base/lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace lanes;
using packet_kernel::Field;
using packet_kernel::kLanes;
using packet_kernel::Tile;

inline void store(const Floats& value, float* packet, Field field) {
  floats_at(packet + field * kLanes) = value;
}

/// Returns the distances of the phases from their nearest integers.
inline Floats off_of(const Tile& t, int column, int colour) {
  constexpr double kShift = 6755399441055744.0;  // 1.5 * 2^52: additions round to integers
  const double c = column;
  return narrowed([&](int row) {
    const auto term = [&](int n) -> const auto& {
      return vector_at<Doubles>(&t.phase[colour][n][row]);
    };
    const Doubles at = term(0).v + c * (term(1).v + c * term(2).v);
    const Doubles lens = (at + kShift) - kShift;
    return at - lens;
  });
}

inline Masks unsure(const Tile& t, const Floats& off) { return off * off > t.safe * t.safe; }

template <int kCoefficients>
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
  store(floats_at(t.origin0[0]) + t.across[0] * x, out, packet_kernel::kOriginX);
  store(floats_at(t.origin0[1]) + t.across[1] * x, out, packet_kernel::kOriginY);
  store(floats_at(t.origin0[2]) + t.across[2] * x, out, packet_kernel::kOriginZ);
  store(floats_at(t.direction0[0]) + t.across[0] * tangent, out, packet_kernel::kDirectionX);
  store(floats_at(t.direction0[1]) + t.across[1] * tangent, out, packet_kernel::kDirectionY);
  store(floats_at(t.direction0[2]) + t.across[2] * tangent, out, packet_kernel::kDirectionZ);
  store(Floats::of(__builtin_inff()), out, packet_kernel::kTFar);
  constexpr uint32_t kNoGeometry = ~0U;
  words_at(out + packet_kernel::kGeometry * kLanes) = Words::of(kNoGeometry);
}

template <int kCoefficients>
bool make_columns(const Tile& t, int column, int count, float* out, int stride) {
  Masks bad{};
  int colour = (t.first_colour + column) % packet_kernel::kColours;
  for (int k = 0; k < count; ++k) {
    const Floats off = off_of(t, column + k, colour);
    bad = bad | unsure(t, off);
    write_rays<kCoefficients>(t, column + k, colour, off, out + k * stride);
    colour = colour == packet_kernel::kColours - 1 ? 0 : colour + 1;
  }
  return any(bad);
}

bool make(const Tile& t, int column, int count, float* out, int stride) {
  return with_constant<2, packet_kernel::kMostCoefficients>(t.coefficients, [&](auto coefficients) {
    return make_columns<coefficients>(t, column, count, out, stride);
  });
}

bool uncertain(const Tile& t, int column) {
  return any(unsure(t, off_of(t, column, (t.first_colour + column) % packet_kernel::kColours)));
}

void make_one(const Tile& t, int column, const float* off, float* out) {
  const int colour = (t.first_colour + column) % packet_kernel::kColours;
  with_constant<2, packet_kernel::kMostCoefficients>(t.coefficients, [&](auto coefficients) {
    write_rays<coefficients>(t, column, colour, floats_at(off), out);
  });
}

}  // namespace

extern const packet_kernel::Kernel kPacketKernel;
const packet_kernel::Kernel kPacketKernel{
    .make = make, .uncertain = uncertain, .make_one = make_one};

}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
