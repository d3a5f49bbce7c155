// SPDX-License-Identifier: Apache-2.0
// Vectors of sixteen lanes and their arithmetic, for kernels that are compiled once per instruction
// set. All definitions are in the namespace of that instruction set only. No operation is fused or
// approximate, so that lanes have the same bits on every instruction set.
#pragma once

#include <cstddef>
#include <cstdint>
#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
#endif

namespace lenticule::render::LENTICULE_ISA_NAMESPACE {
namespace {

// Sixteen lanes are one, two or four vectors of the instruction set, since compilers generate poor
// code for wider vectors.
#if defined(__AVX512F__)
#define LENTICULE_VECTOR_BYTES 64
#elif defined(__AVX2__)
#define LENTICULE_VECTOR_BYTES 32
#else
#define LENTICULE_VECTOR_BYTES 16
#endif
inline constexpr int kWidth = LENTICULE_VECTOR_BYTES / 4;
inline constexpr int kParts = 16 / kWidth;

// The vectors may alias arrays of other types.
using FloatVector = float __attribute__((vector_size(LENTICULE_VECTOR_BYTES), may_alias));
using WordVector = uint32_t __attribute__((vector_size(LENTICULE_VECTOR_BYTES), may_alias));
using MaskVector = int32_t __attribute__((vector_size(LENTICULE_VECTOR_BYTES), may_alias));
#undef LENTICULE_VECTOR_BYTES

template <class Element>
struct VectorOf;
template <>
struct VectorOf<float> {
  using Type = FloatVector;
};
template <>
struct VectorOf<uint32_t> {
  using Type = WordVector;
};
template <>
struct VectorOf<int32_t> {
  using Type = MaskVector;
};

template <class Element>
struct __attribute__((may_alias)) Lanes {
  using Vector = typename VectorOf<Element>::Type;
  Vector part[kParts];

  Element operator[](int lane) const { return part[lane / kWidth][lane % kWidth]; }

  /// Returns lanes that all hold `value`.
  static Lanes of(Element value) {
    Lanes lanes;
    for (Vector& p : lanes.part) p = Vector{} + value;
    return lanes;
  }
};
using Floats = Lanes<float>;
using Words = Lanes<uint32_t>;
using Masks = Lanes<int32_t>;  // -1 is true

#define LENTICULE_LANES_OPERATOR(op, Result)                               \
  template <class E>                                                       \
  inline Result operator op(const Lanes<E>& a, const Lanes<E>& b) {        \
    Result out;                                                            \
    for (int p = 0; p < kParts; ++p) out.part[p] = a.part[p] op b.part[p]; \
    return out;                                                            \
  }                                                                        \
  template <class E>                                                       \
  inline Result operator op(const Lanes<E>& a, E b) {                      \
    return a op Lanes<E>::of(b);                                           \
  }                                                                        \
  template <class E>                                                       \
  inline Result operator op(E a, const Lanes<E>& b) {                      \
    return Lanes<E>::of(a) op b;                                           \
  }
#define LENTICULE_LANES_SAME(op)                                           \
  template <class E>                                                       \
  inline Lanes<E> operator op(const Lanes<E>& a, const Lanes<E>& b) {      \
    Lanes<E> out;                                                          \
    for (int p = 0; p < kParts; ++p) out.part[p] = a.part[p] op b.part[p]; \
    return out;                                                            \
  }                                                                        \
  template <class E>                                                       \
  inline Lanes<E> operator op(const Lanes<E>& a, E b) {                    \
    return a op Lanes<E>::of(b);                                           \
  }                                                                        \
  template <class E>                                                       \
  inline Lanes<E> operator op(E a, const Lanes<E>& b) {                    \
    return Lanes<E>::of(a) op b;                                           \
  }
LENTICULE_LANES_SAME(+)
LENTICULE_LANES_SAME(-)
LENTICULE_LANES_SAME(*)
LENTICULE_LANES_SAME(/)
LENTICULE_LANES_SAME(&)
LENTICULE_LANES_SAME(|)
LENTICULE_LANES_SAME(^)
LENTICULE_LANES_OPERATOR(<, Masks)
LENTICULE_LANES_OPERATOR(>, Masks)
LENTICULE_LANES_OPERATOR(<=, Masks)
LENTICULE_LANES_OPERATOR(>=, Masks)
LENTICULE_LANES_OPERATOR(==, Masks)
LENTICULE_LANES_OPERATOR(!=, Masks)
#undef LENTICULE_LANES_SAME
#undef LENTICULE_LANES_OPERATOR

inline Floats operator-(const Floats& v) {
  Floats out;
  for (int p = 0; p < kParts; ++p) out.part[p] = -v.part[p];
  return out;
}
inline Masks operator~(const Masks& v) {
  Masks out;
  for (int p = 0; p < kParts; ++p) out.part[p] = ~v.part[p];
  return out;
}
template <class E>
inline Lanes<E> operator<<(const Lanes<E>& v, int count) {
  Lanes<E> out;
  for (int p = 0; p < kParts; ++p) out.part[p] = v.part[p] << count;
  return out;
}
template <class E>
inline Lanes<E> operator>>(const Lanes<E>& v, int count) {
  Lanes<E> out;
  for (int p = 0; p < kParts; ++p) out.part[p] = v.part[p] >> count;
  return out;
}
template <class E>
inline Lanes<E> select(const Masks& where, const Lanes<E>& a, const Lanes<E>& b) {
  Lanes<E> out;
  for (int p = 0; p < kParts; ++p) out.part[p] = where.part[p] ? a.part[p] : b.part[p];
  return out;
}

/// Reinterprets the bits as another type.
inline Words words_of(const Floats& v) {
  Words out;
  for (int p = 0; p < kParts; ++p) out.part[p] = reinterpret_cast<WordVector>(v.part[p]);
  return out;
}
inline Masks masks_of(const Words& v) {
  Masks out;
  for (int p = 0; p < kParts; ++p) out.part[p] = reinterpret_cast<MaskVector>(v.part[p]);
  return out;
}
template <class E>
inline Floats floats_of(const Lanes<E>& v) {
  Floats out;
  for (int p = 0; p < kParts; ++p) out.part[p] = reinterpret_cast<FloatVector>(v.part[p]);
  return out;
}
/// Converts the numbers.
inline Floats to_floats(const Masks& v) {
  Floats out;
  for (int p = 0; p < kParts; ++p) out.part[p] = __builtin_convertvector(v.part[p], FloatVector);
  return out;
}
/// Truncates toward zero.
inline Masks to_integers(const Floats& v) {
  Masks out;
  for (int p = 0; p < kParts; ++p) out.part[p] = __builtin_convertvector(v.part[p], MaskVector);
  return out;
}

inline const Floats& floats_at(const float* lanes) {
  return *reinterpret_cast<const Floats*>(lanes);
}
inline Floats& floats_at(float* lanes) {
  return *reinterpret_cast<Floats*>(lanes);
}
/// Returns the integers that Embree's packets keep in arrays of floats.
inline const Words& words_at(const float* lanes) {
  return *reinterpret_cast<const Words*>(lanes);
}
inline const Words& words_in(const uint32_t* lanes) {
  return *reinterpret_cast<const Words*>(lanes);
}
inline const Masks& masks_at(const int32_t* lanes) {
  return *reinterpret_cast<const Masks*>(lanes);
}
inline Masks& masks_at(int32_t* lanes) {
  return *reinterpret_cast<Masks*>(lanes);
}

/// Returns a bit mask of the true lanes.
inline uint32_t bits(const Masks& masks) {
#if defined(__AVX512F__)
  const auto all = reinterpret_cast<__m512i>(masks.part[0]);
  return _mm512_test_epi32_mask(all, all);
#elif defined(__AVX2__)
  const auto low = reinterpret_cast<__m256>(masks.part[0]);
  const auto high = reinterpret_cast<__m256>(masks.part[1]);
  return static_cast<uint32_t>(_mm256_movemask_ps(low)) |
         static_cast<uint32_t>(_mm256_movemask_ps(high)) << 8;
#elif defined(LENTICULE_NEON)
  static constexpr uint32_t kFirst[4] = {1, 2, 4, 8};
  const uint32x4_t first = vld1q_u32(kFirst);
  uint32x4_t sum = vdupq_n_u32(0);
  for (int p = 0; p < kParts; ++p) {
    const auto part = reinterpret_cast<uint32x4_t>(masks.part[p]);
    sum = vorrq_u32(sum, vshlq_u32(vandq_u32(part, first), vdupq_n_s32(4 * p)));
  }
  return vaddvq_u32(sum);
#else
  uint32_t sum = 0;
  for (int r = 0; r < 16; ++r) sum |= static_cast<uint32_t>(masks[r] & 1) << r;
  return sum;
#endif
}
inline bool any(const Masks& masks) {
  return bits(masks) != 0;
}
/// Returns the lanes whose bit is set.
inline Masks lanes_of(uint32_t bits) {
  alignas(64) static constexpr uint32_t kBit[16] = {
      1U << 0, 1U << 1, 1U << 2,  1U << 3,  1U << 4,  1U << 5,  1U << 6,  1U << 7,
      1U << 8, 1U << 9, 1U << 10, 1U << 11, 1U << 12, 1U << 13, 1U << 14, 1U << 15};
  return (words_in(kBit) & bits) != 0U;
}

inline Floats min(const Floats& a, const Floats& b) {
  return select(a < b, a, b);
}
inline Floats max(const Floats& a, const Floats& b) {
  return select(a > b, a, b);
}
/// Clamps to [0, 1]; NaN becomes 0.
inline Floats clamp01(const Floats& v) {
  return select(v > 0.0F, select(v < 1.0F, v, Floats::of(1.0F)), Floats{});
}
inline Floats absolute(const Floats& v) {
  return floats_of(words_of(v) & 0x7fffffffU);
}
inline Floats root(const Floats& v) {
  Floats out;
  for (int p = 0; p < kParts; ++p) {
#if defined(__AVX512F__)
    out.part[p] = reinterpret_cast<FloatVector>(
        _mm512_maskz_sqrt_ps(static_cast<__mmask16>(~0U), reinterpret_cast<__m512>(v.part[p])));
#elif defined(__AVX2__)
    out.part[p] =
        reinterpret_cast<FloatVector>(_mm256_sqrt_ps(reinterpret_cast<__m256>(v.part[p])));
#else
    for (int r = 0; r < kWidth; ++r) out.part[p][r] = __builtin_sqrtf(v.part[p][r]);
#endif
  }
  return out;
}
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
/// (render/culling/octahedron.h) of `count` x `count` cells.
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
