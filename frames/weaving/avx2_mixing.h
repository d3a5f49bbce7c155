// SPDX-License-Identifier: Apache-2.0
// Mixing in linear light with AVX2. Include only in files that are compiled for AVX2: each file has
// its own copies of these functions, so that none of them can be linked into code for every
// processor.
#pragma once

#include <immintrin.h>

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

inline __m256i both(__m128i low, __m128i high) {
  return _mm256_inserti128_si256(_mm256_castsi128_si256(low), high, 1);
}

/// Returns a + (b - a) weight, rounded; words.
inline __m256i mix(__m256i a, __m256i b, __m256i weight) {
  return _mm256_add_epi16(a, _mm256_mulhrs_epi16(_mm256_sub_epi16(b, a), weight));
}

/// Mixes pairs of words to 32 bits. The weights are w - 2^15 and -w, since 2^15 itself does not
/// fit.
inline __m256i mix_pairs(__m256i pairs, __m256i weights) {
  const __m256i half = _mm256_set1_epi32(1 << (kWeightBits - 1));
  return _mm256_srli_epi32(_mm256_sub_epi32(half, _mm256_madd_epi16(pairs, weights)), kWeightBits);
}

}  // namespace
}  // namespace lenticule::frames::weave_kernel
