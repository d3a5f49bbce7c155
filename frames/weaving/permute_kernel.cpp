// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic for a whole record at once. With the views of a pixel side by side
// in one register, choosing a view is a permutation of bytes: one instruction serves all subpixels
// of a lens in four rows. Only intrinsics and plain data are used here, because this file is
// compiled for processors that not every machine has.
//
// Lanes of a register: four rows of sixteen, in each the eight subpixels' views a, then a + 1.
#include <immintrin.h>

#if defined(__GNUC__) && !defined(__clang__)
// gcc 12 mistakes the "undefined" registers of its own intrinsics for uninitialised variables.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

constexpr int kPixelBytes = 3 * kViewLanes;

/// LightTable maps 256 codes to light: low and high bytes, in four registers each.
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

/// ColourLanes holds the lanes with the first, second and third of three places' colours.
struct ColourLanes {
  uint64_t of[3];
};

/// ColourTable is indexed by the colours that the rows' runs begin with, encoded as Quad::colours.
struct ColourTable {
  ColourLanes lanes[256];
};

constexpr ColourTable colour_table() {
  ColourTable table{};
  for (int colours = 0; colours < 256; ++colours)
    for (int r = 0; r < kRows; ++r)
      for (int n = 0; n < kRun; ++n)
        table.lanes[colours].of[((colours >> (2 * r) & 3) + n) % 3] |= uint64_t{0x101}
                                                                       << (16 * r + n);
  return table;
}
constexpr ColourTable kColours = colour_table();

/// Views holds the view numbers of a record as words, a row per 128 bits, eight subpixels each.
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

/// Choice selects a record's lanes among the 3 x 64 codes of a pixel: two colours at once, then the
/// third.
struct Choice {
  __m512i index;
  __mmask64 blue;
};

Choice choice_of(const Quad& quad, bool blue_first, __m512i index) {
  const ColourLanes& lanes = kColours.lanes[quad.colours];
  const __m512i second = _mm512_set1_epi8(kViewLanes);
  return {_mm512_mask_add_epi8(index, lanes.of[1], index, second), lanes.of[blue_first ? 0 : 2]};
}

__m512i choose(const Choice& choice, const uint8_t* pixel) {
  const __m512i two = _mm512_permutex2var_epi8(_mm512_load_si512(pixel), choice.index,
                                               _mm512_load_si512(pixel + kViewLanes));
  return _mm512_mask_permutexvar_epi8(two, choice.blue, choice.index,
                                      _mm512_load_si512(pixel + 2 * kViewLanes));
}

/// Codes holds the codes of a record's four pixels.
struct Codes {
  __m512i upper_left, upper_right, lower_left, lower_right;
};

/// Pair holds two neighbouring columns in one picture row.
struct Pair {
  __m512i left, right;
};

Pair choose_pair(const Choice& choice, const uint8_t* pixel) {
  return {choose(choice, pixel), choose(choice, pixel + kPixelBytes)};
}

/// RowPattern describes the picture rows that the four rows of a set use.
struct RowPattern {
  const uint8_t *top, *middle, *bottom;  ///< the set's last rows have the middle one as their upper
  __mmask64 last;                        ///< lanes of those last rows, if any
  bool simple;                           ///< true if the rows have this pattern
};

RowPattern pattern_of(const TransposedRows& rows) {
  int same = 1;
  while (same < kRows && rows.upper[same] == rows.upper[0]) ++same;
  bool simple = same == kRows || rows.upper[same] == rows.lower[0];
  for (int r = same; r < kRows; ++r) simple = simple && rows.upper[r] == rows.upper[same];
  return {.top = static_cast<const uint8_t*>(rows.upper[0]),
          .middle = static_cast<const uint8_t*>(rows.lower[0]),
          .bottom = static_cast<const uint8_t*>(rows.lower[kRows - 1]),
          .last = same == kRows ? 0 : ~uint64_t{0} << (16 * same),
          .simple = simple};
}

/// Chooses codes when all rows use the same columns.
Codes choose_simply(const RowPattern& rows, const Choice& choice, size_t pixel) {
  const Pair top = choose_pair(choice, rows.top + pixel);
  const Pair middle = choose_pair(choice, rows.middle + pixel);
  if (rows.last == 0) return {top.left, top.right, middle.left, middle.right};
  const Pair bottom = choose_pair(choice, rows.bottom + pixel);
  return {_mm512_mask_blend_epi8(rows.last, top.left, middle.left),
          _mm512_mask_blend_epi8(rows.last, top.right, middle.right),
          _mm512_mask_blend_epi8(rows.last, middle.left, bottom.left),
          _mm512_mask_blend_epi8(rows.last, middle.right, bottom.right)};
}

/// Chooses codes row by row; rows that use the same pixels are handled together.
Codes choose_by_rows(const TransposedRows& rows, const Quad& quad, const Choice& choice) {
  const __m512i none = _mm512_setzero_si512();
  Codes codes{none, none, none, none};
  for (int begin = 0; begin < kRows;) {
    int end = begin + 1;
    while (end < kRows && quad.column[end] == quad.column[begin] &&
           rows.upper[end] == rows.upper[begin])
      ++end;
    const __mmask64 lanes = (~uint64_t{0} >> (64 - 16 * (end - begin))) << (16 * begin);
    const size_t pixel = static_cast<size_t>(quad.column[begin]) * kPixelBytes;
    const Pair upper = choose_pair(choice, static_cast<const uint8_t*>(rows.upper[begin]) + pixel);
    const Pair lower = choose_pair(choice, static_cast<const uint8_t*>(rows.lower[begin]) + pixel);
    codes.upper_left = _mm512_mask_mov_epi8(codes.upper_left, lanes, upper.left);
    codes.upper_right = _mm512_mask_mov_epi8(codes.upper_right, lanes, upper.right);
    codes.lower_left = _mm512_mask_mov_epi8(codes.lower_left, lanes, lower.left);
    codes.lower_right = _mm512_mask_mov_epi8(codes.lower_right, lanes, lower.right);
    begin = end;
  }
  return codes;
}

bool has_one_column(const Quad& quad) {
  return ((quad.column[0] ^ quad.column[1]) | (quad.column[0] ^ quad.column[2]) |
          (quad.column[0] ^ quad.column[3])) == 0;
}

/// Returns a + (b - a) weight, rounded.
__m512i mix(__m512i a, __m512i b, __m512i weight) {
  return _mm512_add_epi16(a, _mm512_mulhrs_epi16(_mm512_sub_epi16(b, a), weight));
}

/// Light holds one pixel's light in both views.
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

/// Returns four 16-bit values, one per row, in all words of the row.
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

/// Records pass each step in batches: the steps of one record depend on each other, the steps of
/// several records do not, and a processor looks about a hundred instructions ahead.
constexpr uint32_t kBatch = 8;
struct Batch {
  Views views[kBatch];
  __m512i column_weight[kBatch];
  Codes codes[kBatch];
  __m512i light[kBatch];
};

/// A frame's records exceed the caches, so they are prefetched this far ahead.
constexpr uint32_t kQuadsAhead = 64;
void fetch_quads(const Quad* quads, uint32_t begin, uint32_t end) {
  for (uint32_t q = begin; q < begin + kBatch && q < end; ++q)
    _mm_prefetch(reinterpret_cast<const char*>(quads + q), _MM_HINT_T0);
}

void place_batch(const Terms& terms, const Quad* quads, uint32_t count, Batch& batch) {
  for (uint32_t n = 0; n < count; ++n) {
    batch.views[n] = views_of(terms, quads[n]);
    batch.column_weight[n] = column_weights(quads[n]);
  }
}

void choose_batch(const Terms& terms, const TransposedRows& rows, const Quad* quads, uint32_t count,
                  Batch& batch) {
  const RowPattern pattern = pattern_of(rows);
  for (uint32_t n = 0; n < count; ++n) {
    const Choice choice = choice_of(quads[n], terms.blue_first, batch.views[n].index);
    batch.codes[n] = pattern.simple && has_one_column(quads[n])
                         ? choose_simply(pattern, choice, quads[n].column[0] * size_t{kPixelBytes})
                         : choose_by_rows(rows, quads[n], choice);
  }
}

void mix_batch(const LightTable& table, __m512i row_weight, uint32_t count, Batch& batch) {
  for (uint32_t n = 0; n < count; ++n) {
    const Codes& codes = batch.codes[n];
    const Light left =
        mix(light_of(table, codes.upper_left), light_of(table, codes.lower_left), row_weight);
    const Light right =
        mix(light_of(table, codes.upper_right), light_of(table, codes.lower_right), row_weight);
    const Light both_views = mix(left, right, batch.column_weight[n]);
    batch.light[n] = mix(both_views.a, both_views.b, batch.views[n].weight);
  }
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

/// Transposes sixteen by sixteen in each of the four parts of a register, by interleaving the bytes
/// of halves four times.
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

/// The hardware prefetcher does not follow so many rows at once, so they are prefetched explicitly.
constexpr size_t kAhead = 256;
void fetch_ahead(const Pictures& pictures, size_t at) {
  for (int view = 0; view < pictures.views; ++view)
    _mm_prefetch(reinterpret_cast<const char*>(pictures.first[view] + at), _MM_HINT_T0);
}

/// Loads sixteen bytes of each view, one view per part of a register. Parts without views stay
/// empty.
template <int kParts>
__m512i sixteen_of(const uint8_t* const* views, size_t at) {
  __m512i bytes = _mm512_zextsi128_si512(sixteen_bytes(views[0] + at));
  if (kParts > 1) bytes = _mm512_inserti32x4(bytes, sixteen_bytes(views[16] + at), 1);
  if (kParts > 2) bytes = _mm512_inserti32x4(bytes, sixteen_bytes(views[32] + at), 2);
  if (kParts > 3) bytes = _mm512_inserti32x4(bytes, sixteen_bytes(views[48] + at), 3);
  return bytes;
}

/// Transposes as many bytes of the row as fit into groups of sixteen, and returns their number.
template <int kParts>
size_t transpose_sixteens(const Pictures& pictures, size_t begin, size_t bytes,
                          uint8_t* transposed) {
  size_t at = 0;
  for (; at + 16 <= bytes; at += 16) {
    if (at % 64 == 0) fetch_ahead(pictures, begin + at + kAhead);
    __m512i rows[16];
    for (int n = 0; n < 16; ++n) rows[n] = sixteen_of<kParts>(pictures.first + n, begin + at);
    transpose_16(rows);
    for (size_t n = 0; n < 16; ++n) _mm512_store_si512(transposed + (at + n) * kViewLanes, rows[n]);
  }
  return at;
}

size_t transpose_most(const Pictures& pictures, size_t begin, size_t bytes, uint8_t* transposed) {
  if (pictures.views <= 16) return transpose_sixteens<1>(pictures, begin, bytes, transposed);
  if (pictures.views <= 32) return transpose_sixteens<2>(pictures, begin, bytes, transposed);
  if (pictures.views <= 48) return transpose_sixteens<3>(pictures, begin, bytes, transposed);
  return transpose_sixteens<4>(pictures, begin, bytes, transposed);
}

}  // namespace

void transpose_row(const Pictures& pictures, int row, uint8_t* transposed) noexcept {
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t bytes = 3 * static_cast<size_t>(pictures.width);
  for (size_t at = transpose_most(pictures, begin, bytes, transposed); at < bytes; ++at)
    for (int view = 0; view < pictures.views; ++view)
      transposed[at * kViewLanes + static_cast<size_t>(view)] = pictures.first[view][begin + at];
  for (size_t c = 0; c < 3; ++c)
    _mm512_store_si512(transposed + (bytes + c) * kViewLanes,
                       _mm512_load_si512(transposed + (bytes - 3 + c) * kViewLanes));
}

void mix_set_by_permuting(const Terms& terms, const TransposedRows& rows, const Set& set,
                          const Quad* quads, const Target& target) noexcept {
  const LightTable table = light_table(terms.light);
  const __m512i row_weight = per_row(set.row_share);
  Batch batch;
  for (uint32_t q = set.quads_begin; q < set.quads_end; q += kBatch) {
    const uint32_t count = set.quads_end - q < kBatch ? set.quads_end - q : kBatch;
    fetch_quads(quads, q + kQuadsAhead, set.quads_end);
    place_batch(terms, quads + q, count, batch);
    choose_batch(terms, rows, quads + q, count, batch);
    mix_batch(table, row_weight, count, batch);
    for (uint32_t n = 0; n < count; ++n) store_rows(batch.light[n], set, quads[q + n], target);
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
