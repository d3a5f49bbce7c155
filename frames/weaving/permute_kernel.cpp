// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic for a whole quad at once. With the views of a pixel side by side in
// one register, choosing a view is a permutation of bytes: one instruction serves all subpixels of
// a lens in four rows. Only intrinsics and plain data here: this file is compiled for processors
// that not everybody has.
//
// Lanes of a register: four rows of sixteen, in each the eight subpixels' views a, then a + 1.
#include <immintrin.h>

#if defined(__GNUC__) && !defined(__clang__)
// gcc 12 takes its own intrinsics' "undefined" registers for variables that were forgotten.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

constexpr int kPixelBytes = 3 * kViewLanes;

/// 256 codes to light: low and high bytes, in four registers each.
struct LightTable {
  __m512i low[4], high[4];
};

LightTable light_table(const uint16_t* light) {
  alignas(64) uint8_t low[256], high[256];
  for (int code = 0; code < 256; ++code) {
    low[code] = static_cast<uint8_t>(light[code] & 0xff);
    high[code] = static_cast<uint8_t>(light[code] >> 8);
  }
  LightTable table;
  for (int part = 0; part < 4; ++part) {
    table.low[part] = _mm512_load_si512(low + 64 * part);
    table.high[part] = _mm512_load_si512(high + 64 * part);
  }
  return table;
}

/// Which lanes have which colour.
struct ChannelMasks {
  uint64_t of[3];
};

/// By the colours that the rows' runs begin with, as Quad::colours counts them.
struct MaskTable {
  ChannelMasks masks[256];
};

constexpr MaskTable mask_table() {
  MaskTable table{};
  for (int colours = 0; colours < 256; ++colours)
    for (int r = 0; r < kRows; ++r)
      for (int n = 0; n < kRun; ++n)
        table.masks[colours].of[((colours >> (2 * r) & 3) + n) % 3] |= uint64_t{0x101}
                                                                       << (16 * r + n);
  return table;
}
constexpr MaskTable kMasks = mask_table();

ChannelMasks channel_masks(const Quad& quad, bool blue_first) {
  const ChannelMasks& masks = kMasks.masks[quad.colours];
  return blue_first ? ChannelMasks{{masks.of[2], masks.of[1], masks.of[0]}} : masks;
}

/// View numbers of a quad as words, a row per 128 bits, eight subpixels each.
struct Views {
  __m512i index;   ///< bytes: a, then a + 1
  __m512i weight;  ///< words
};

Views views_of(const Terms& terms, const Quad& quad) {
  const __m512i by_row = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
  const __m512i along = _mm512_set_epi32(3, 2, 1, 0, 3, 2, 1, 0, 3, 2, 1, 0, 3, 2, 1, 0);
  const __m512i none = _mm512_setzero_si512(), most = _mm512_set1_epi32(terms.view_most);
  const __m128i start = _mm_loadu_si128(reinterpret_cast<const __m128i*>(quad.view));
  const __m512i step = _mm512_set1_epi32(terms.view_step + quad.view_step);
  __m512i left = _mm512_add_epi32(_mm512_permutexvar_epi32(by_row, _mm512_castsi128_si512(start)),
                                  _mm512_mullo_epi32(along, step));
  __m512i right = _mm512_add_epi32(left, _mm512_slli_epi32(step, 2));
  left = _mm512_min_epi32(_mm512_max_epi32(left, none), most);
  right = _mm512_min_epi32(_mm512_max_epi32(right, none), most);

  const __m512i mask = _mm512_set1_epi32(terms.weight_mask);
  const auto weight = [&](__m512i view) {
    return _mm512_and_si512(_mm512_srli_epi32(view, kViewBits - kWeightBits), mask);
  };
  const __m512i a =
      _mm512_packs_epi32(_mm512_srli_epi32(left, kViewBits), _mm512_srli_epi32(right, kViewBits));
  const __m512i b = _mm512_add_epi16(a, _mm512_set1_epi16(1));
  return {_mm512_packus_epi16(a, b), _mm512_packs_epi32(weight(left), weight(right))};
}

/// The codes of a quad's four taps.
struct Codes {
  __m512i upper_left, upper_right, lower_left, lower_right;
};

__m512i choose(__m512i codes, const ChannelMasks& lanes, __m512i index, const uint8_t* pixel) {
  codes = _mm512_mask_permutexvar_epi8(codes, lanes.of[0], index, _mm512_load_si512(pixel));
  codes = _mm512_mask_permutexvar_epi8(codes, lanes.of[1], index,
                                       _mm512_load_si512(pixel + kViewLanes));
  return _mm512_mask_permutexvar_epi8(codes, lanes.of[2], index,
                                      _mm512_load_si512(pixel + 2 * kViewLanes));
}

void choose_rows(Codes& codes, const ChannelMasks& lanes, __m512i index, const uint8_t* upper,
                 const uint8_t* lower) {
  codes.upper_left = choose(codes.upper_left, lanes, index, upper);
  codes.upper_right = choose(codes.upper_right, lanes, index, upper + kPixelBytes);
  codes.lower_left = choose(codes.lower_left, lanes, index, lower);
  codes.lower_right = choose(codes.lower_right, lanes, index, lower + kPixelBytes);
}

/// Rows that look at the same pixels are served together.
Codes choose_codes(const TurnedRows& rows, const Quad& quad, bool blue_first, __m512i index) {
  const ChannelMasks all = channel_masks(quad, blue_first);
  const __m512i none = _mm512_setzero_si512();
  Codes codes{none, none, none, none};
  for (int begin = 0; begin < kRows;) {
    int end = begin + 1;
    while (end < kRows && quad.column[end] == quad.column[begin] &&
           rows.upper[end] == rows.upper[begin])
      ++end;
    const uint64_t lanes = (~uint64_t{0} >> (64 - 16 * (end - begin))) << (16 * begin);
    const size_t pixel = static_cast<size_t>(quad.column[begin]) * kPixelBytes;
    const ChannelMasks some{{all.of[0] & lanes, all.of[1] & lanes, all.of[2] & lanes}};
    choose_rows(codes, some, index, static_cast<const uint8_t*>(rows.upper[begin]) + pixel,
                static_cast<const uint8_t*>(rows.lower[begin]) + pixel);
    begin = end;
  }
  return codes;
}

/// a + (b - a) weight, rounded.
__m512i mix(__m512i a, __m512i b, __m512i weight) {
  return _mm512_add_epi16(a, _mm512_mulhrs_epi16(_mm512_sub_epi16(b, a), weight));
}

/// One tap's light in both views.
struct Light {
  __m512i a, b;
};

Light light_of(const LightTable& table, __m512i codes) {
  const __mmask64 upper_half = _mm512_movepi8_mask(codes);
  const __m512i low = _mm512_mask_blend_epi8(
      upper_half, _mm512_permutex2var_epi8(table.low[0], codes, table.low[1]),
      _mm512_permutex2var_epi8(table.low[2], codes, table.low[3]));
  const __m512i high = _mm512_mask_blend_epi8(
      upper_half, _mm512_permutex2var_epi8(table.high[0], codes, table.high[1]),
      _mm512_permutex2var_epi8(table.high[2], codes, table.high[3]));
  return {_mm512_unpacklo_epi8(low, high), _mm512_unpackhi_epi8(low, high)};
}

Light mix(const Light& a, const Light& b, __m512i weight) {
  return {mix(a.a, b.a, weight), mix(a.b, b.b, weight)};
}

/// Four 16-bit values, one per row, in all words of the row.
__m512i per_row(const void* four) {
  const __m512i by_row = _mm512_set_epi16(3, 3, 3, 3, 3, 3, 3, 3, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1,
                                          1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0);
  return _mm512_permutexvar_epi16(
      by_row, _mm512_castsi128_si512(_mm_loadl_epi64(static_cast<const __m128i*>(four))));
}

__m512i column_weights(const Quad& quad) {
  const __m512i along = _mm512_broadcast_i32x4(_mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0));
  const __m512i step = _mm512_add_epi16(
      per_row(quad.column_step), _mm512_mullo_epi16(along, _mm512_set1_epi16(quad.column_bend)));
  const __m512i bend = _mm512_srai_epi16(_mm512_mullo_epi16(along, step), kSlopeBits);
  return _mm512_add_epi16(per_row(quad.share), bend);
}

void store_rows(__m512i light, const Set& set, const Quad& quad, const Target& target) {
  uint16_t* const out = target.light + set.first;
  const auto row = [&](int r) {
    return reinterpret_cast<__m128i*>(out + static_cast<size_t>(r) * target.light_stride +
                                      quad.at[r]);
  };
  _mm_storeu_si128(row(0), _mm512_castsi512_si128(light));
  _mm_storeu_si128(row(1), _mm512_extracti32x4_epi32(light, 1));
  _mm_storeu_si128(row(2), _mm512_extracti32x4_epi32(light, 2));
  _mm_storeu_si128(row(3), _mm512_extracti32x4_epi32(light, 3));
}

/// Interleaving the bytes of halves four times over transposes sixteen by sixteen, here in each of
/// the four parts of a register.
void transpose_16(__m512i (&rows)[16]) {
  for (int round = 0; round < 4; ++round) {
    __m512i next[16];
    for (int n = 0; n < 8; ++n) {
      next[2 * n] = _mm512_unpacklo_epi8(rows[n], rows[n + 8]);
      next[2 * n + 1] = _mm512_unpackhi_epi8(rows[n], rows[n + 8]);
    }
    for (int n = 0; n < 16; ++n) rows[n] = next[n];
  }
}

__m128i sixteen_bytes(const uint8_t* from) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
}

/// So many rows at once are more than processors follow by themselves.
constexpr size_t kAhead = 512;
void fetch_ahead(const Pictures& pictures, size_t at) {
  for (int view = 0; view < pictures.views; ++view)
    _mm_prefetch(reinterpret_cast<const char*>(pictures.first[view] + at), _MM_HINT_T0);
}

}  // namespace

void turn_row(const Pictures& pictures, int row, uint8_t* turned) noexcept {
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t bytes = 3 * static_cast<size_t>(pictures.width);
  size_t at = 0;
  for (; at + 16 <= bytes; at += 16) {
    if (at % 64 == 0) fetch_ahead(pictures, begin + at + kAhead);
    __m512i rows[16];
    for (int n = 0; n < 16; ++n) {
      __m512i views = _mm512_castsi128_si512(sixteen_bytes(pictures.first[n] + begin + at));
      views = _mm512_inserti32x4(views, sixteen_bytes(pictures.first[n + 16] + begin + at), 1);
      views = _mm512_inserti32x4(views, sixteen_bytes(pictures.first[n + 32] + begin + at), 2);
      rows[n] = _mm512_inserti32x4(views, sixteen_bytes(pictures.first[n + 48] + begin + at), 3);
    }
    transpose_16(rows);
    for (int n = 0; n < 16; ++n)
      _mm512_store_si512(turned + (at + static_cast<size_t>(n)) * kViewLanes, rows[n]);
  }
  for (; at < bytes; ++at)
    for (int view = 0; view < pictures.views; ++view)
      turned[at * kViewLanes + static_cast<size_t>(view)] = pictures.first[view][begin + at];
  for (int c = 0; c < 3; ++c)
    _mm512_store_si512(
        turned + (bytes + static_cast<size_t>(c)) * kViewLanes,
        _mm512_load_si512(turned + (bytes - 3 + static_cast<size_t>(c)) * kViewLanes));
}

void mix_set_by_permuting(const Terms& terms, const TurnedRows& rows, const Set& set,
                          const Quad* quads, const Target& target) noexcept {
  const LightTable table = light_table(terms.light);
  const __m512i row_weight = per_row(set.row_share);
  for (uint32_t q = set.quads_begin; q < set.quads_end; ++q) {
    const Quad& quad = quads[q];
    const Views views = views_of(terms, quad);
    const Codes codes = choose_codes(rows, quad, terms.blue_first, views.index);
    const Light left =
        mix(light_of(table, codes.upper_left), light_of(table, codes.lower_left), row_weight);
    const Light right =
        mix(light_of(table, codes.upper_right), light_of(table, codes.lower_right), row_weight);
    const Light both_views = mix(left, right, column_weights(quad));
    store_rows(mix(both_views.a, both_views.b, views.weight), set, quad, target);
  }
}

void encode_by_permuting(const Terms& terms, const uint16_t* light, size_t count,
                         uint8_t* codes) noexcept {
  const int16_t* const curve = terms.curve;
  __m512i part[8];
  for (int n = 0; n < 8; ++n) part[n] = _mm512_load_si512(curve + 32 * n);
  const __m512i fraction = _mm512_set1_epi16(0x7fff);
  size_t at = 0;
  for (; at + 32 <= count; at += 32) {
    const __m512i x = _mm512_loadu_si512(light + at);
    const __mmask32 high = _mm512_cmpge_epi16_mask(x, _mm512_set1_epi16(2048));
    const __m512i low_n = _mm512_srli_epi16(x, 5), high_n = _mm512_srli_epi16(x, 9);
    const __m512i start =
        _mm512_mask_blend_epi16(high, _mm512_permutex2var_epi16(part[0], low_n, part[1]),
                                _mm512_permutex2var_epi16(part[4], high_n, part[5]));
    const __m512i rise =
        _mm512_mask_blend_epi16(high, _mm512_permutex2var_epi16(part[2], low_n, part[3]),
                                _mm512_permutex2var_epi16(part[6], high_n, part[7]));
    const __m512i rest = _mm512_and_si512(
        _mm512_mask_blend_epi16(high, _mm512_slli_epi16(x, 10), _mm512_slli_epi16(x, 6)), fraction);
    const __m512i code =
        _mm512_srli_epi16(_mm512_add_epi16(start, _mm512_mulhrs_epi16(rise, rest)), 7);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(codes + at), _mm512_cvtepi16_epi8(code));
  }
  for (; at < count; ++at) codes[at] = terms.codes[light[at]];
}

}  // namespace lenticule::frames::weave_kernel
