// SPDX-License-Identifier: Apache-2.0
// Vectors and their arithmetic, for kernels that are compiled once per instruction set. All
// definitions are private to the including source, so that the linker cannot choose a copy of
// another instruction set. No operation is fused or approximate, so that all instruction sets give
// the same bits.
//
// There are two kinds of vectors. Vector<Element, count> is the compiler's own: it may be wider or
// narrower than a register, and its comparisons and selections (`mask ? a : b`) are split lane by
// lane by some compilers if it is wider. Floats, Words and Masks have sixteen lanes in one, two or
// four registers, and functions pass them by reference. In all masks, -1 is true.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>
#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
#endif

namespace lenticule::lanes {
namespace {

template <class Element, int kCount>
struct VectorOf {
  using Type [[gnu::vector_size(kCount * sizeof(Element))]] = Element;
};
template <class Element, int kCount>
using Vector = typename VectorOf<Element, kCount>::Type;

/// A vector `v` that may lie at any address, in an array of any type. Compilers drop `aligned` and
/// `may_alias` from the type of a vector where it becomes a reference or a template's argument, but
/// not from a member.
template <class Vector>
struct __attribute__((packed, may_alias)) Unaligned {
  Vector v;
};

/// Returns the vector that begins at an element of an array.
template <class Vector, class Element>
inline Unaligned<Vector>& vector_at(Element* at) {
  return *reinterpret_cast<Unaligned<Vector>*>(at);
}
template <class Vector, class Element>
inline const Unaligned<Vector>& vector_at(const Element* at) {
  return *reinterpret_cast<const Unaligned<Vector>*>(at);
}

/// Calls `call` with the constant that equals `n`, which is between kFirst and kLast: the compiler
/// unrolls loops up to it.
template <int kFirst, int kLast, class Call>
inline auto with_constant(int n, const Call& call) {
  if constexpr (kFirst == kLast)
    return call(std::integral_constant<int, kLast>());
  else if (n == kFirst)
    return call(std::integral_constant<int, kFirst>());
  else
    return with_constant<kFirst + 1, kLast>(n, call);
}

// --- sixteen lanes

#if defined(__AVX512F__)
#define LENTICULE_VECTOR_BYTES 64
#elif defined(__AVX2__)
#define LENTICULE_VECTOR_BYTES 32
#else
#define LENTICULE_VECTOR_BYTES 16
#endif
inline constexpr int kWidth = LENTICULE_VECTOR_BYTES / 4;  ///< floats in a register
inline constexpr int kParts = 16 / kWidth;

// The vectors may alias arrays of other types.
using FloatVector = float __attribute__((vector_size(LENTICULE_VECTOR_BYTES), may_alias));
using WordVector = uint32_t __attribute__((vector_size(LENTICULE_VECTOR_BYTES), may_alias));
using MaskVector = int32_t __attribute__((vector_size(LENTICULE_VECTOR_BYTES), may_alias));
#undef LENTICULE_VECTOR_BYTES

/// Number of doubles that a register holds.
inline constexpr int kDoubles = kWidth / 2;
using Doubles = Vector<double, kDoubles>;
using DoubleMasks = Vector<int64_t, kDoubles>;

inline Doubles root(const Doubles& v) {
#if defined(__AVX512F__)
  return reinterpret_cast<Doubles>(
      _mm512_maskz_sqrt_pd(static_cast<__mmask8>(~0U), reinterpret_cast<__m512d>(v)));
#elif defined(__AVX2__)
  return reinterpret_cast<Doubles>(_mm256_sqrt_pd(reinterpret_cast<__m256d>(v)));
#else
  Doubles out;
  for (int n = 0; n < kDoubles; ++n) out[n] = __builtin_sqrt(v[n]);
  return out;
#endif
}

template <class Element>
struct RegisterOf;
template <>
struct RegisterOf<float> {
  using Type = FloatVector;
};
template <>
struct RegisterOf<uint32_t> {
  using Type = WordVector;
};
template <>
struct RegisterOf<int32_t> {
  using Type = MaskVector;
};

template <class Element>
struct __attribute__((may_alias)) Lanes {
  using Vector = typename RegisterOf<Element>::Type;
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
using Masks = Lanes<int32_t>;

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
LENTICULE_LANES_OPERATOR(+, Lanes<E>)
LENTICULE_LANES_OPERATOR(-, Lanes<E>)
LENTICULE_LANES_OPERATOR(*, Lanes<E>)
LENTICULE_LANES_OPERATOR(/, Lanes<E>)
LENTICULE_LANES_OPERATOR(&, Lanes<E>)
LENTICULE_LANES_OPERATOR(|, Lanes<E>)
LENTICULE_LANES_OPERATOR(^, Lanes<E>)
LENTICULE_LANES_OPERATOR(<, Masks)
LENTICULE_LANES_OPERATOR(>, Masks)
LENTICULE_LANES_OPERATOR(<=, Masks)
LENTICULE_LANES_OPERATOR(>=, Masks)
LENTICULE_LANES_OPERATOR(==, Masks)
LENTICULE_LANES_OPERATOR(!=, Masks)
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

/// Load and store sixteen elements at any address.
template <class E>
inline Lanes<E> load(const E* at) {
  Lanes<E> out;
  for (int p = 0; p < kParts; ++p)
    out.part[p] = vector_at<typename Lanes<E>::Vector>(at + p * kWidth).v;
  return out;
}
template <class E>
inline void store(const Lanes<E>& lanes, E* at) {
  for (int p = 0; p < kParts; ++p)
    vector_at<typename Lanes<E>::Vector>(at + p * kWidth).v = lanes.part[p];
}

/// Return the lanes in an array at a multiple of 64 bytes.
inline const Floats& floats_at(const float* lanes) {
  return *reinterpret_cast<const Floats*>(lanes);
}
inline Floats& floats_at(float* lanes) { return *reinterpret_cast<Floats*>(lanes); }
/// Returns the integers that Embree's packets keep in arrays of floats.
inline const Words& words_at(const float* lanes) { return *reinterpret_cast<const Words*>(lanes); }
inline Words& words_at(float* lanes) { return *reinterpret_cast<Words*>(lanes); }
inline const Words& words_in(const uint32_t* lanes) {
  return *reinterpret_cast<const Words*>(lanes);
}
inline const Masks& masks_at(const int32_t* lanes) {
  return *reinterpret_cast<const Masks*>(lanes);
}
inline Masks& masks_at(int32_t* lanes) { return *reinterpret_cast<Masks*>(lanes); }

/// Rounds doubles to floats; `part(n)` returns those of the lanes from n on.
template <class Part>
inline Floats narrowed(const Part& part) {
  using Half = Vector<float, kDoubles>;
  Floats out;
  for (int p = 0; p < kParts; ++p) {
    const Half low = __builtin_convertvector(part(p * kWidth), Half);
    const Half high = __builtin_convertvector(part(p * kWidth + kDoubles), Half);
#if defined(__AVX512F__)
    out.part[p] =
        __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
#elif defined(__AVX2__)
    out.part[p] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
#else
    out.part[p] = __builtin_shufflevector(low, high, 0, 1, 2, 3);
#endif
  }
  return out;
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
  // Counts down, since GCC 12 with sanitizers miscompiles shifts by a counter.
  for (int r = 16; r-- > 0;) sum = 2 * sum + static_cast<uint32_t>(masks[r] & 1);
  return sum;
#endif
}
inline bool any(const Masks& masks) { return bits(masks) != 0; }
/// Returns the lanes whose bit is set.
inline Masks lanes_of(uint32_t bits) {
  alignas(64) static constexpr uint32_t kBit[16] = {
      1U << 0, 1U << 1, 1U << 2,  1U << 3,  1U << 4,  1U << 5,  1U << 6,  1U << 7,
      1U << 8, 1U << 9, 1U << 10, 1U << 11, 1U << 12, 1U << 13, 1U << 14, 1U << 15};
  return (words_in(kBit) & bits) != 0U;
}

inline Floats min(const Floats& a, const Floats& b) { return select(a < b, a, b); }
inline Floats max(const Floats& a, const Floats& b) { return select(a > b, a, b); }
/// Clamps to [0, 1]; NaN becomes 0.
inline Floats clamp01(const Floats& v) {
  return select(v > 0.0F, select(v < 1.0F, v, Floats::of(1.0F)), Floats{});
}
inline Floats absolute(const Floats& v) { return floats_of(words_of(v) & 0x7fffffffU); }
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

}  // namespace
}  // namespace lenticule::lanes
