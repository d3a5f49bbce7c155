// SPDX-License-Identifier: Apache-2.0
// Functions of sixteen lanes (base/lanes.h) that several kernels of rendering use: points,
// directions and powers.
#pragma once

#include <cstdint>

#include "base/lanes.h"

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace lanes;

inline Masks clamp_index(const Masks& v, const Masks& count) {
  const Masks last = count - 1;
  const Masks held = select(v < last, v, last);
  return select(held > 0, held, Masks{});
}

struct Floats3 {
  Floats x, y, z;
};
inline Floats3 operator+(const Floats3& a, const Floats3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Floats3 operator-(const Floats3& a, const Floats3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Floats3 operator-(const Floats3& a) { return {-a.x, -a.y, -a.z}; }
inline Floats3 operator*(const Floats3& a, const Floats& s) { return {a.x * s, a.y * s, a.z * s}; }
inline Floats dot(const Floats3& a, const Floats3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Floats3 cross(const Floats3& a, const Floats3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Normalizes; the zero vector stays zero.
inline Floats3 unit(const Floats3& v) {
  const Floats length = root(dot(v, v));
  return v * select(length > 0.0F, 1.0F / length, Floats{});
}
inline Floats3 select(const Masks& where, const Floats3& a, const Floats3& b) {
  return {select(where, a.x, b.x), select(where, a.y, b.y), select(where, a.z, b.z)};
}
inline Floats3 spread(const float (&v)[3]) {
  return {Floats::of(v[0]), Floats::of(v[1]), Floats::of(v[2])};
}

/// Finds the cell of a direction on the octahedron that is unfolded to a square
/// (render/culling/shaft.h) of `count` x `count` cells.
inline void octahedron_cell(const Floats3& d, const Masks& count, Masks& u, Masks& v) {
  const Floats sum = absolute(d.x) + absolute(d.y) + absolute(d.z);
  const Floats scale = select(sum > 0.0F, 1.0F / sum, Floats{});
  const Floats x = d.x * scale, y = d.y * scale;
  const Masks lower = d.z < 0.0F;
  const Floats folded_x = 1.0F - absolute(y), folded_y = 1.0F - absolute(x);
  const Floats at_x = select(lower, select(x < 0.0F, -folded_x, folded_x), x);
  const Floats at_y = select(lower, select(y < 0.0F, -folded_y, folded_y), y);
  const Floats half = 0.5F * to_floats(count);
  u = clamp_index(to_integers(max((at_x + 1.0F) * half, Floats{})), count);
  v = clamp_index(to_integers(max((at_y + 1.0F) * half, Floats{})), count);
}

/// Returns the logarithm to base 2 of positive, normal numbers. The logarithm of the mantissa m is
/// the series of 2 artanh(z) / ln 2, z = (m - 1) / (m + 1); the first omitted term is below 1e-9 of
/// the sum.
inline Floats log2_of(const Floats& v) {
  constexpr uint32_t kRootHalf = 0x3f3504f3U;  // bits of sqrt(1/2)
  const Words above = words_of(v) - kRootHalf;
  const Masks exponent = masks_of(above) >> 23;
  const Floats m = floats_of((above & 0x007fffffU) + kRootHalf);
  const Floats z = (m - 1.0F) / (m + 1.0F);
  const Floats q = z * z;
  const Floats series =
      z * (2.8853900818F +
           q * (0.9617966939F + q * (0.5770780164F + q * (0.4121985831F + q * 0.3205988980F))));
  return to_floats(exponent) + series;
}

/// Returns 2^t; 0 for t below -126.
inline Floats exp2_of(const Floats& t) {
  const Floats held = max(min(t, Floats::of(127.0F)), Floats::of(-127.0F));
  constexpr float kShift = 12582912.0F;  // 1.5 * 2^23: additions round to integers
  const Floats whole = (held + kShift) - kShift;
  const Floats f = held - whole;
  // Coefficients: ln(2)^k / k!
  const Floats series =
      1.0F + f * (0.6931471806F +
                  f * (0.2402265070F +
                       f * (0.0555041087F +
                            f * (0.0096181291F +
                                 f * (0.0013333558F + f * (0.0001540353F + f * 0.0000152527F))))));
  const Masks scale = (to_integers(whole) + 127) << 23;
  return select(t < -126.0F, Floats{}, series * floats_of(scale));
}

/// Returns x^y for positive x and y >= 0.
inline Floats power(const Floats& x, const Floats& y) {
  constexpr float kSmallestNormal = 1.17549435e-38F;
  return exp2_of(y * log2_of(max(x, Floats::of(kSmallestNormal))));
}

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
