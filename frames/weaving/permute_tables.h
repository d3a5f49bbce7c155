// SPDX-License-Identifier: Apache-2.0
// Tables that fill several AVX-512 registers, in two ways that give the same bytes. Include only in
// files that are compiled for AVX-512 with VBMI: each file has its own copies of these functions.
#pragma once

#include <immintrin.h>

#include <cstddef>
#include <cstdint>

namespace lenticule::frames::weave_kernel {
namespace {

inline constexpr size_t kRegisterBytes = 64;
inline constexpr uint64_t kSecondEight = 0xff00ff00ff00ff00;

inline __m512i register_at(const uint8_t* pixel, int n) {
  return _mm512_load_si512(pixel + static_cast<size_t>(n) * kRegisterBytes);
}

/// Pieces holds the curve for 16-bit light: 64 pieces of 32 below 2048, and 64 pieces of 512.
struct Pieces {
  __m512i low[2], high[2];
};

/// Pairs looks up two registers at once, which is one operation for AMD.
struct Pairs {
  /// Returns bytes of a table of kParts registers in memory.
  template <int kParts>
  static __m512i bytes_at(__m512i index, const uint8_t* table) {
    if (kParts == 1) return _mm512_permutexvar_epi8(index, register_at(table, 0));
    const __m512i two =
        _mm512_permutex2var_epi8(register_at(table, 0), index, register_at(table, 1));
    if (kParts == 2) return two;
    const __mmask64 beyond = _mm512_movepi8_mask(index);
    if (kParts == 3) return _mm512_mask_permutexvar_epi8(two, beyond, index, register_at(table, 2));
    return _mm512_mask_blend_epi8(
        beyond, two, _mm512_permutex2var_epi8(register_at(table, 2), index, register_at(table, 3)));
  }
  /// Returns bytes of the first register for the first eight of each sixteen, else of the second.
  static __m512i bytes_by_eights(__m512i index, __m512i first, __m512i second) {
    const __m512i in_second = _mm512_maskz_set1_epi8(kSecondEight, 64);
    return _mm512_permutex2var_epi8(first, _mm512_or_si512(index, in_second), second);
  }
  /// Returns bytes of a table of 256.
  static __m512i bytes_of(const __m512i (&table)[4], __m512i index) {
    return _mm512_mask_blend_epi8(_mm512_movepi8_mask(index),
                                  _mm512_permutex2var_epi8(table[0], index, table[1]),
                                  _mm512_permutex2var_epi8(table[2], index, table[3]));
  }
  static __m512i words_of(const Pieces& pieces, __m512i light, __mmask32 high) {
    return _mm512_mask_blend_epi16(
        high, _mm512_permutex2var_epi16(pieces.low[0], _mm512_srli_epi16(light, 5), pieces.low[1]),
        _mm512_permutex2var_epi16(pieces.high[0], _mm512_srli_epi16(light, 9), pieces.high[1]));
  }
};

/// Singles looks up one register after the other and keeps what belongs to it. Intel's processors
/// split a permutation of two registers into three operations.
struct Singles {
  /// Quarters tells in which part of a table bytes are looked up.
  struct Quarters {
    explicit Quarters(__m512i index)
        : odd(_mm512_movepi8_mask(_mm512_add_epi8(index, index))),
          late(_mm512_movepi8_mask(index)),
          last(_kand_mask64(odd, late)) {}
    __mmask64 odd;   ///< lanes of the second or the last register
    __mmask64 late;  ///< lanes of the third or the last register
    __mmask64 last;  ///< lanes of the last register
  };

  template <int kParts>
  static __m512i bytes_at(__m512i index, const uint8_t* table) {
    const Quarters in(index);
    __m512i bytes = _mm512_permutexvar_epi8(index, register_at(table, 0));
    const auto add = [&](__mmask64 lanes, int n) {
      bytes = _mm512_mask_permutexvar_epi8(bytes, lanes, index, register_at(table, n));
    };
    if (kParts > 1) add(in.odd, 1);
    if (kParts > 2) add(in.late, 2);
    if (kParts > 3) add(in.last, 3);
    return bytes;
  }
  static __m512i bytes_by_eights(__m512i index, __m512i first, __m512i second) {
    return _mm512_mask_permutexvar_epi8(_mm512_permutexvar_epi8(index, first), kSecondEight, index,
                                        second);
  }
  static __m512i bytes_of(const __m512i (&table)[4], __m512i index) {
    const Quarters in(index);
    __m512i bytes = _mm512_permutexvar_epi8(index, table[0]);
    bytes = _mm512_mask_permutexvar_epi8(bytes, in.odd, index, table[1]);
    bytes = _mm512_mask_permutexvar_epi8(bytes, in.late, index, table[2]);
    return _mm512_mask_permutexvar_epi8(bytes, in.last, index, table[3]);
  }
  /// Takes the upper half of each kind of pieces by the highest bit of its number.
  static __m512i words_of(const Pieces& pieces, __m512i light, __mmask32 high) {
    const __m512i low_n = _mm512_srli_epi16(light, 5), high_n = _mm512_srli_epi16(light, 9);
    const __mmask32 low_half = _mm512_movepi16_mask(_mm512_slli_epi16(light, 5));
    const __mmask32 high_half = _mm512_movepi16_mask(_mm512_add_epi16(light, light));
    __m512i words = _mm512_permutexvar_epi16(low_n, pieces.low[0]);
    words = _mm512_mask_permutexvar_epi16(words, low_half, low_n, pieces.low[1]);
    words = _mm512_mask_permutexvar_epi16(words, high, high_n, pieces.high[0]);
    return _mm512_mask_permutexvar_epi16(words, high_half, high_n, pieces.high[1]);
  }
};

}  // namespace
}  // namespace lenticule::frames::weave_kernel
