// SPDX-License-Identifier: Apache-2.0
// The Gaussian view filter with AVX2: one subpixel after the other, eight of its views at once.
#include "frames/weaving/avx2_mixing.h"

namespace lenticule::frames::weave_kernel {
namespace {

constexpr int kViewsAtOnce = 8;

/// Look holds the inputs of a subpixel: the first entries of its pixel and colour, and the weights
/// of rows and columns.
struct Look {
  const uint16_t *upper, *lower;
  __m256i row_weight, column_weights;
};

/// Returns the light of eight views from `view` on, 32 bits each.
__m256i views_light(const Look& look, int view) {
  const auto entries = [&](const uint16_t* first) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(first + 2 * view));
  };
  const __m256i columns = mix(entries(look.upper), entries(look.lower), look.row_weight);
  return mix_pairs(columns, look.column_weights);
}

/// Returns weights n and the seven after it, 32 bits each; weights from `end` on are zero.
__m256i weights_at(const uint16_t* weights, int n, int end) {
  const __m256i along = _mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0);
  const __m256i counts = _mm256_cmpgt_epi32(_mm256_set1_epi32(end - n), along);
  const __m128i words = _mm_loadu_si128(reinterpret_cast<const __m128i*>(weights + n));
  return _mm256_and_si256(_mm256_cvtepu16_epi32(words), counts);
}

int64_t sum_of(__m256i values) {
  const __m128i four =
      _mm_add_epi32(_mm256_castsi256_si128(values), _mm256_extracti128_si256(values, 1));
  const __m128i two = _mm_add_epi32(four, _mm_shuffle_epi32(four, 0b01001110));
  return _mm_cvtsi128_si32(_mm_add_epi32(two, _mm_shuffle_epi32(two, 0b10110001)));
}

/// Returns a subpixel's light under the spot. A product has 31 bits, so its halves are summed
/// separately.
uint16_t spot_light(const Spot& spot, const Look& look, int32_t number) {
  const int part = (number & ((1 << kViewBits) - 1)) >> (kViewBits - spot.bits);
  const uint16_t* const weights = spot.weights + static_cast<ptrdiff_t>(part) * spot.taps;
  const int first = (number >> kViewBits) - spot.reach;
  const int end = spot.taps < spot.views - first ? spot.taps : spot.views - first;
  __m256i low = _mm256_setzero_si256(), high = low, sum = low;
  for (int n = first < 0 ? -first : 0; n < end; n += kViewsAtOnce) {
    const __m256i weight = weights_at(weights, n, end);
    const __m256i product = _mm256_mullo_epi32(views_light(look, first + n), weight);
    low = _mm256_add_epi32(low, _mm256_and_si256(product, _mm256_set1_epi32(0xffff)));
    high = _mm256_add_epi32(high, _mm256_srli_epi32(product, 16));
    sum = _mm256_add_epi32(sum, weight);
  }
  const int64_t all = sum_of(sum), light = (sum_of(high) << 16) + sum_of(low);
  return all > 0 ? static_cast<uint16_t>((light + all / 2) / all) : uint16_t{0};
}

__m256i column_weights(int weight) {
  const uint32_t rest = static_cast<uint32_t>(weight - (1 << kWeightBits)) & 0xffff;
  return _mm256_set1_epi32(static_cast<int>(static_cast<uint32_t>(-weight) << 16 | rest));
}

/// Mixes one row of a record.
void mix_run(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad& quad,
             int r, uint16_t* light) {
  const int step = terms.view_step + quad.view_step;
  const int count = (quad.counts >> (4 * r)) & 15;
  const size_t entry = 2 * rows.lanes;
  for (int n = 0; n < count; ++n) {
    const size_t place = set.first + (size_t{quad.at[r]} + static_cast<size_t>(n)) * set.stride;
    const size_t colour = terms.blue_first ? 2 - place % 3 : place % 3;
    const size_t at = (size_t{quad.column[r]} * 3 + colour) * entry;
    const int bend = (n * (quad.column_step[r] + n * quad.column_bend)) >> kSlopeBits;
    const Look look{static_cast<const uint16_t*>(rows.upper[r]) + at,
                    static_cast<const uint16_t*>(rows.lower[r]) + at,
                    _mm256_set1_epi16(set.row_share[r]), column_weights(quad.share[r] + bend)};
    light[place] = spot_light(terms.spot, look, quad.view[r] + n * step);
  }
}

}  // namespace

void mix_spot_set_avx2(const Terms& terms, const TransposedRows& rows, const Set& set,
                       const Quad* quads, const Target& target) noexcept {
  for (uint32_t q = set.quads_begin; q < set.quads_end; ++q)
    for (int r = 0; r < kRows; ++r)
      mix_run(terms, rows, set, quads[q], r, target.light + static_cast<size_t>(r) * target.stride);
}

}  // namespace lenticule::frames::weave_kernel
