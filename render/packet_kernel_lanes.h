// SPDX-License-Identifier: Apache-2.0
// Vectors of sixteen lanes and their arithmetic, for kernels that are compiled once per instruction
// set. Everything is in the namespace of that instruction set and in no other. No step is fused or
// approximate, so that lanes have the same bits everywhere.
#pragma once

#include <cstddef>
#include <cstdint>
#if defined(__AVX512F__)
#include <immintrin.h>
#endif

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

// They may look at arrays of other types; the compiler cuts them into what the instruction set has.
using Floats = float __attribute__((vector_size(64), may_alias));
using Words = uint32_t __attribute__((vector_size(64), may_alias));
using Masks = int32_t __attribute__((vector_size(64), may_alias));  // -1 is true

inline const Floats& floats_at(const float* lanes) {
  return *reinterpret_cast<const Floats*>(lanes);
}
inline Floats& floats_at(float* lanes) {
  return *reinterpret_cast<Floats*>(lanes);
}
/// Whole numbers where a packet of Embree's keeps its floats.
inline const Words& words_at(const float* lanes) {
  return *reinterpret_cast<const Words*>(lanes);
}
inline const Masks& masks_at(const int32_t* lanes) {
  return *reinterpret_cast<const Masks*>(lanes);
}
inline Masks& masks_at(int32_t* lanes) {
  return *reinterpret_cast<Masks*>(lanes);
}

inline bool any(const Masks& masks) {
#if defined(__AVX512F__)
  const auto all = reinterpret_cast<__m512i>(masks);
  return _mm512_test_epi32_mask(all, all) != 0;
#else
  int32_t sum = 0;
  for (int r = 0; r < 16; ++r) sum |= masks[r];
  return sum != 0;
#endif
}

/// A bit for each lane that is true.
inline uint32_t bits(const Masks& masks) {
#if defined(__AVX512F__)
  const auto all = reinterpret_cast<__m512i>(masks);
  return _mm512_test_epi32_mask(all, all);
#else
  uint32_t sum = 0;
  for (int r = 0; r < 16; ++r) sum |= static_cast<uint32_t>(masks[r] & 1) << r;
  return sum;
#endif
}

inline Floats min(const Floats& a, const Floats& b) {
  return a < b ? a : b;
}
inline Floats max(const Floats& a, const Floats& b) {
  return a > b ? a : b;
}
/// NaN becomes 0.
inline Floats clamp01(const Floats& v) {
  return v > 0.0F ? (v < 1.0F ? v : Floats{} + 1.0F) : Floats{};
}
inline Floats absolute(const Floats& v) {
  return reinterpret_cast<Floats>(reinterpret_cast<Words>(v) & 0x7fffffffU);
}
inline Floats root(const Floats& v) {
#if defined(__AVX512F__)
  return reinterpret_cast<Floats>(
      _mm512_maskz_sqrt_ps(static_cast<__mmask16>(~0U), reinterpret_cast<__m512>(v)));
#else
  Floats out;
  for (int r = 0; r < 16; ++r) out[r] = __builtin_sqrtf(v[r]);
  return out;
#endif
}

/// The integer below, of numbers between 0 and 2^22.
inline Masks below(const Floats& v) {
  return __builtin_convertvector(v, Masks);
}
inline Masks clamp_index(const Masks& v, const Masks& count) {
  const Masks last = count - 1;
  const Masks held = v < last ? v : last;
  return held > 0 ? held : Masks{};
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
inline Floats3 operator-(const Floats3& a) {
  return {-a.x, -a.y, -a.z};
}
inline Floats3 operator*(const Floats3& a, const Floats& s) {
  return {a.x * s, a.y * s, a.z * s};
}
inline Floats dot(const Floats3& a, const Floats3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Floats3 cross(const Floats3& a, const Floats3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// The zero vector stays zero.
inline Floats3 unit(const Floats3& v) {
  const Floats length = root(dot(v, v));
  return v * (length > 0.0F ? 1.0F / length : Floats{});
}
inline Floats3 select(const Masks& where, const Floats3& a, const Floats3& b) {
  return {where ? a.x : b.x, where ? a.y : b.y, where ? a.z : b.z};
}
inline Floats3 spread(const float (&v)[3]) {
  return {Floats{} + v[0], Floats{} + v[1], Floats{} + v[2]};
}

/// Where a direction lies on the octahedron that is unfolded to a square (render/octahedron.h), in
/// `count` x `count` cells.
inline void octahedron_cell(const Floats3& d, const Masks& count, Masks& u, Masks& v) {
  const Floats sum = absolute(d.x) + absolute(d.y) + absolute(d.z);
  const Floats scale = sum > 0.0F ? 1.0F / sum : Floats{};
  const Floats x = d.x * scale, y = d.y * scale;
  const Masks lower = d.z < 0.0F;
  const Floats folded_x = 1.0F - absolute(y), folded_y = 1.0F - absolute(x);
  const Floats at_x = lower ? (x < 0.0F ? -folded_x : folded_x) : x;
  const Floats at_y = lower ? (y < 0.0F ? -folded_y : folded_y) : y;
  const Floats half = 0.5F * __builtin_convertvector(count, Floats);
  u = clamp_index(below(max((at_x + 1.0F) * half, Floats{})), count);
  v = clamp_index(below(max((at_y + 1.0F) * half, Floats{})), count);
}

/// Logarithm to base 2 of positive, normal numbers: of the mantissa about 1 by the series of
/// 2 artanh(z) / ln 2, z = (m - 1) / (m + 1), whose first term left out is below 1e-9 of the sum.
inline Floats log2_of(const Floats& v) {
  constexpr uint32_t kRootHalf = 0x3f3504f3U;  // bits of sqrt(1/2)
  const Words bits = reinterpret_cast<Words>(v);
  const Words above = bits - kRootHalf;
  const Masks exponent = reinterpret_cast<Masks>(above) >> 23;
  const Floats m = reinterpret_cast<Floats>((above & 0x007fffffU) + kRootHalf);
  const Floats z = (m - 1.0F) / (m + 1.0F);
  const Floats q = z * z;
  const Floats series =
      z * (2.8853900818F +
           q * (0.9617966939F + q * (0.5770780164F + q * (0.4121985831F + q * 0.3205988980F))));
  return __builtin_convertvector(exponent, Floats) + series;
}

/// 2^t; 0 for t below -126.
inline Floats exp2_of(const Floats& t) {
  const Floats held = max(min(t, Floats{} + 127.0F), Floats{} - 127.0F);
  constexpr float kShift = 12582912.0F;  // 1.5 * 2^23: additions round to integers
  const Floats whole = (held + kShift) - kShift;
  const Floats f = held - whole;
  // ln(2)^k / k!
  const Floats series =
      1.0F + f * (0.6931471806F +
                  f * (0.2402265070F +
                       f * (0.0555041087F +
                            f * (0.0096181291F +
                                 f * (0.0013333558F + f * (0.0001540353F + f * 0.0000152527F))))));
  const Masks scale = (__builtin_convertvector(whole, Masks) + 127) << 23;
  return t < -126.0F ? Floats{} : series * reinterpret_cast<Floats>(scale);
}

/// x^y for positive x and y >= 0.
inline Floats power(const Floats& x, const Floats& y) {
  constexpr float kSmallestNormal = 1.17549435e-38F;
  return exp2_of(y * log2_of(max(x, Floats{} + kSmallestNormal)));
}

}  // namespace
}  // namespace lenticule::render::LENTICULE_ISA_NAMESPACE
