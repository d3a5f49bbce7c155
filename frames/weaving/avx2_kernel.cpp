// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic for a run of eight subpixels at once, for processors with AVX2. The
// inputs of a subpixel lie in two places: eight bytes of its upper and of its lower picture row
// hold the light of two views in two columns. Loads of eight bytes are about equally fast on all
// processors, gathers are not.
#include "frames/weaving/avx2_mixing.h"

namespace lenticule::frames::weave_kernel {
namespace {

/// RunTerms holds the values that are constant for all records of a set.
struct RunTerms {
  explicit RunTerms(const Terms& terms, const TransposedRows& rows, const Set& set,
                    const Target& target);

  __m256i view_most, weight_mask;
  __m256i colours[4];  ///< byte offsets to the eight subpixels' colours, by the first one's colour
  __m256i row_weight[kRows];
  const char* upper[kRows];
  const char* lower[kRows];
  uint16_t* out[kRows];  ///< place 0
  size_t column_bytes;
};

/// Subpixels of a stripe are adjacent; subpixels of a single colour are a stride apart.
RunTerms::RunTerms(const Terms& terms, const TransposedRows& rows, const Set& set,
                   const Target& target)
    : view_most(_mm256_set1_epi32(terms.view_most)),
      weight_mask(_mm256_set1_epi32(terms.weight_mask)),
      column_bytes(3 * rows.lanes * 4) {
  for (uint32_t begin = 0; begin < 4; ++begin) {
    alignas(32) uint32_t offset[kRun];
    for (uint32_t n = 0; n < kRun; ++n) {
      const uint32_t colour = (set.first + (set.stride == 1 ? begin + n : 0)) % 3;
      offset[n] = static_cast<uint32_t>((terms.blue_first ? 2 - colour : colour) * rows.lanes * 4);
    }
    colours[begin] = _mm256_load_si256(reinterpret_cast<const __m256i*>(offset));
  }
  for (int r = 0; r < kRows; ++r) {
    row_weight[r] = _mm256_set1_epi16(set.row_share[r]);
    upper[r] = static_cast<const char*>(rows.upper[r]);
    lower[r] = static_cast<const char*>(rows.lower[r]);
    out[r] = target.light + static_cast<size_t>(r) * target.stride + set.first;
  }
}

/// Views holds the views of eight subpixels.
struct Views {
  __m256i offset;   ///< offset of the first view's entry, in bytes
  __m256i weights;  ///< weights for mix_pairs()
};

Views views_of(const RunTerms& run, __m256i number) {
  number = _mm256_max_epi32(number, _mm256_setzero_si256());
  number = _mm256_min_epi32(number, run.view_most);
  const __m256i weight =
      _mm256_and_si256(_mm256_srli_epi32(number, kViewBits - kWeightBits), run.weight_mask);
  const __m256i pair = _mm256_sub_epi32(weight, _mm256_slli_epi32(weight, 16));
  return {_mm256_slli_epi32(_mm256_srli_epi32(number, kViewBits), 2),
          _mm256_xor_si256(pair, _mm256_set1_epi32(0x8000))};
}

/// Columns holds the column weights of a run's subpixels: 0, 1, 4, 5 and 2, 3, 6, 7, each for two
/// views.
struct Columns {
  __m256i outer, inner;
};

/// Computes column weights; `bends` is n column_bend.
Columns columns_of(const Quad& quad, int r, __m128i bends) {
  const __m128i along = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
  const __m128i moved =
      _mm_mullo_epi16(along, _mm_add_epi16(_mm_set1_epi16(quad.column_step[r]), bends));
  const __m128i weight = _mm_add_epi16(_mm_set1_epi16(static_cast<int16_t>(quad.share[r])),
                                       _mm_srai_epi16(moved, kSlopeBits));
  const __m128i rest = _mm_xor_si128(weight, _mm_set1_epi16(static_cast<int16_t>(0x8000)));
  const __m128i negative = _mm_sub_epi16(_mm_setzero_si128(), weight);
  const __m256i pairs =
      both(_mm_unpacklo_epi16(rest, negative), _mm_unpackhi_epi16(rest, negative));
  return {_mm256_unpacklo_epi32(pairs, pairs), _mm256_unpackhi_epi32(pairs, pairs)};
}

/// Loads two entries of eight bytes.
__m128i two_entries(const char* row, uint32_t first, uint32_t second) {
  const __m128i low = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(row + first));
  return _mm_castps_si128(
      _mm_loadh_pi(_mm_castsi128_ps(low), reinterpret_cast<const __m64*>(row + second)));
}

/// Loads the entries of subpixels n, n + 1, n + 4 and n + 5.
__m256i four_entries(const char* row, const uint32_t* offset) {
  return both(two_entries(row, offset[0], offset[1]), two_entries(row, offset[4], offset[5]));
}

[[gnu::always_inline]] inline __m128i mixed_run(const RunTerms& run, const Quad& quad, int r,
                                                __m256i steps, __m128i bends) {
  const Views views = views_of(run, _mm256_add_epi32(_mm256_set1_epi32(quad.view[r]), steps));
  const Columns columns = columns_of(quad, r, bends);
  alignas(32) uint32_t offset[kRun];
  _mm256_store_si256(reinterpret_cast<__m256i*>(offset),
                     _mm256_add_epi32(views.offset, run.colours[(quad.colours >> (2 * r)) & 3]));
  const size_t pixel = quad.column[r] * run.column_bytes;
  const char *const upper = run.upper[r] + pixel, *const lower = run.lower[r] + pixel;
  const __m256i outer =
      mix(four_entries(upper, offset), four_entries(lower, offset), run.row_weight[r]);
  const __m256i inner =
      mix(four_entries(upper, offset + 2), four_entries(lower, offset + 2), run.row_weight[r]);
  const __m256i both_views =
      _mm256_packs_epi32(mix_pairs(outer, columns.outer), mix_pairs(inner, columns.inner));
  const __m256i light = mix_pairs(both_views, views.weights);
  return _mm_packs_epi32(_mm256_castsi256_si128(light), _mm256_extracti128_si256(light, 1));
}

/// Stores runs of a single colour, which have gaps.
void store_apart(__m128i light, size_t stride, int count, uint16_t* first) {
  alignas(16) uint16_t words[kRun];
  _mm_store_si128(reinterpret_cast<__m128i*>(words), light);
  for (int n = 0; n < count; ++n) first[static_cast<size_t>(n) * stride] = words[n];
}

template <bool kStripes>
void mix_quad(const RunTerms& run, const Terms& terms, size_t stride, const Quad& quad) {
  const __m256i along = _mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0);
  const __m256i steps =
      _mm256_mullo_epi32(along, _mm256_set1_epi32(terms.view_step + quad.view_step));
  const __m128i bends =
      _mm_mullo_epi16(_mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0), _mm_set1_epi16(quad.column_bend));
  for (int r = 0; r < kRows; ++r) {
    const int count = (quad.counts >> (4 * r)) & 15;
    if (count == 0) continue;
    const __m128i light = mixed_run(run, quad, r, steps, bends);
    if (kStripes) {
      _mm_storeu_si128(reinterpret_cast<__m128i*>(run.out[r] + quad.at[r]), light);
    } else {
      store_apart(light, stride, count, run.out[r] + quad.at[r] * stride);
    }
  }
}

/// A frame's records exceed the caches, so they are prefetched this far ahead.
constexpr uint32_t kQuadsAhead = 32;

constexpr int kTile = 32;  ///< bytes of each view that are transposed at once

/// Transposes sixteen registers of two times sixteen bytes, in both parts.
void transpose_16(__m256i (&rows)[16]) {
  for (int round = 0; round < 4; ++round) {
    __m256i next[16];
    for (int n = 0; n < 8; ++n) {
      next[2 * n] = _mm256_unpacklo_epi8(rows[n], rows[n + 8]);
      next[2 * n + 1] = _mm256_unpackhi_epi8(rows[n], rows[n + 8]);
    }
    for (int n = 0; n < 16; ++n) rows[n] = next[n];
  }
}

/// Curve is LightCurve in registers.
struct Curve {
  __m256i start_low, start_high, rise_low, rise_high, bend;
};

Curve curve_of(const uint8_t* points) {
  const auto part = [&](int n) {
    return _mm256_broadcastsi128_si256(
        _mm_load_si128(reinterpret_cast<const __m128i*>(points + 16 * n)));
  };
  return {part(0), part(1), part(2), part(3), part(4)};
}

/// Evaluates the curve for words with zero-extended t: start + ((t (rise + (t bend + 4 >> 3)) + 4)
/// >> 3).
__m256i along_curve(__m256i t, __m256i start, __m256i rise, __m256i bend) {
  const __m256i half = _mm256_set1_epi16(4);
  const __m256i slope = _mm256_add_epi16(
      rise, _mm256_srli_epi16(_mm256_add_epi16(_mm256_mullo_epi16(t, bend), half), 3));
  return _mm256_add_epi16(
      start, _mm256_srli_epi16(_mm256_add_epi16(_mm256_mullo_epi16(t, slope), half), 3));
}

struct Light {
  __m256i low, high;  ///< bytes 0..7 and 8..15 of both parts
};

Light light_of(const Curve& curve, __m256i codes) {
  const __m256i nibble = _mm256_set1_epi8(15), none = _mm256_setzero_si256();
  const __m256i n = _mm256_and_si256(_mm256_srli_epi16(codes, 4), nibble);
  const __m256i t = _mm256_and_si256(codes, nibble);
  const __m256i start_low = _mm256_shuffle_epi8(curve.start_low, n);
  const __m256i start_high = _mm256_shuffle_epi8(curve.start_high, n);
  const __m256i rise_low = _mm256_shuffle_epi8(curve.rise_low, n);
  const __m256i rise_high = _mm256_shuffle_epi8(curve.rise_high, n);
  const __m256i bend = _mm256_shuffle_epi8(curve.bend, n);
  return {along_curve(_mm256_unpacklo_epi8(t, none), _mm256_unpacklo_epi8(start_low, start_high),
                      _mm256_unpacklo_epi8(rise_low, rise_high), _mm256_unpacklo_epi8(bend, none)),
          along_curve(_mm256_unpackhi_epi8(t, none), _mm256_unpackhi_epi8(start_low, start_high),
                      _mm256_unpackhi_epi8(rise_low, rise_high), _mm256_unpackhi_epi8(bend, none))};
}

/// Order of the views in the lanes while transposing, such that joining two columns sorts them.
constexpr int kLaneViews[kLaneStep] = {0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13, 14, 15};

/// Tile holds the light of sixteen views, in that order, at kTile places.
struct Tile {
  alignas(32) uint16_t light[kTile][kLaneStep];
};

void turn_tile(const Curve& curve, const uint8_t* const* views, size_t at, Tile& tile) {
  __m256i rows[16];
  for (int n = 0; n < 16; ++n)
    rows[n] = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(views[kLaneViews[n]] + at));
  transpose_16(rows);
  for (int n = 0; n < 16; ++n) {
    const Light light = light_of(curve, rows[n]);
    auto* const low = reinterpret_cast<__m256i*>(tile.light[n]);
    auto* const high = reinterpret_cast<__m256i*>(tile.light[16 + n]);
    _mm256_store_si256(low, _mm256_permute2x128_si256(light.low, light.high, 0x20));
    _mm256_store_si256(high, _mm256_permute2x128_si256(light.low, light.high, 0x31));
  }
}

/// Transposes fewer bytes than a tile has, without reading behind them.
void turn_rest(const Curve& curve, const uint8_t* const* views, size_t at, size_t bytes,
               Tile& tile) {
  uint8_t codes[kLaneStep][kTile] = {};
  const uint8_t* rows[kLaneStep];
  for (size_t view = 0; view < kLaneStep; ++view) {
    for (size_t n = 0; n < bytes; ++n) codes[view][n] = views[view][at + n];
    rows[view] = codes[view];
  }
  turn_tile(curve, rows, 0, tile);
}

/// Stores one entry of sixteen views from the light of two columns.
void store_entries(const uint16_t* here, const uint16_t* next, uint16_t* entries) {
  const __m256i a = _mm256_load_si256(reinterpret_cast<const __m256i*>(here));
  const __m256i b = _mm256_load_si256(reinterpret_cast<const __m256i*>(next));
  auto* const out = reinterpret_cast<__m256i*>(entries);
  _mm256_store_si256(out, _mm256_unpacklo_epi16(a, b));
  _mm256_store_si256(out + 1, _mm256_unpackhi_epi16(a, b));
}

/// The hardware prefetcher does not follow so many rows at once, so they are prefetched explicitly.
constexpr size_t kAhead = 512;
void fetch_ahead(const uint8_t* const* views, size_t at) {
  for (size_t view = 0; view < kLaneStep; ++view)
    _mm_prefetch(reinterpret_cast<const char*>(views[view] + at), _MM_HINT_T0);
}

/// Transposes a tile of sixteen views' rows, which begin at `begin` and have `bytes`. The next tile
/// begins with the last three places of this tile, whose next columns that tile knows; only the
/// places of the last column have no next column.
void turn_views(const Curve& curve, const uint8_t* const* views, size_t begin, size_t at,
                size_t bytes, size_t lanes, uint16_t* light) {
  const size_t count = bytes - at < kTile ? bytes - at : kTile, entry = 2 * lanes;
  Tile tile;
  if (count == kTile) {
    turn_tile(curve, views, begin + at, tile);
  } else {
    turn_rest(curve, views, begin + at, count, tile);
  }
  for (size_t n = 0; n + 3 < count; ++n)
    store_entries(tile.light[n], tile.light[n + 3], light + (at + n) * entry);
  if (at + count < bytes) return;
  for (size_t n = count - 3; n < count; ++n)
    store_entries(tile.light[n], tile.light[n], light + (at + n) * entry);
}

}  // namespace

void turn_light_avx2(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                     uint16_t* light) noexcept {
  const Curve curve = curve_of(terms.light_curve);
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t bytes = 3 * static_cast<size_t>(pictures.width);
  for (size_t at = 0; at + 3 < bytes || at == 0; at += kTile - 3) {
    for (size_t view = 0; view < lanes; view += kLaneStep) {
      const uint8_t* const* const views = pictures.first + view;
      fetch_ahead(views, begin + at + kAhead);
      turn_views(curve, views, begin, at, bytes, lanes, light + 2 * view);
    }
  }
}

void mix_set_avx2(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad* quads,
                  const Target& target) noexcept {
  const RunTerms run(terms, rows, set, target);
  if (set.stride == 1) {
    for (uint32_t q = set.quads_begin; q < set.quads_end; ++q) {
      if (q + kQuadsAhead < set.quads_end)
        _mm_prefetch(reinterpret_cast<const char*>(quads + q + kQuadsAhead), _MM_HINT_T0);
      mix_quad<true>(run, terms, 1, quads[q]);
    }
  } else {
    for (uint32_t q = set.quads_begin; q < set.quads_end; ++q)
      mix_quad<false>(run, terms, set.stride, quads[q]);
  }
}

}  // namespace lenticule::frames::weave_kernel
