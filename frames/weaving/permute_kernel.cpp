// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic for a whole record at once. With the views of a pixel side by side
// in one register, choosing a view is a permutation of bytes: one instruction serves all subpixels
// of a lens in four rows. Only intrinsics and plain data are used here, because this file is
// compiled for processors that not every machine has.
//
// A pixel's codes fill one to four registers: four bytes for each view, in the order of the places'
// colours, the fourth unused. Lanes of all other registers: four rows of sixteen bytes, in each the
// eight subpixels of a run twice. With a filter that mixes views they are views a, then a + 1; with
// the nearest view they are the left column, then the right one.
#include <immintrin.h>

#if defined(__GNUC__) && !defined(__clang__)
// gcc 12 mistakes the "undefined" registers of its own intrinsics for uninitialised variables.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

#include "base/lanes.h"
#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

constexpr int kViewsPerRegister = 16;
constexpr size_t kRegisterBytes = 64;
constexpr uint64_t kSecondEight = 0xff00ff00ff00ff00;

__m512i register_at(const uint8_t* pixel, int n) {
  return _mm512_load_si512(pixel + static_cast<size_t>(n) * kRegisterBytes);
}

/// Pieces holds the curve for 16-bit light: 64 pieces of 32 below 2048, and 64 pieces of 512.
struct Pieces {
  __m512i low[2], high[2];
};

/// Returns bytes of a table of kParts registers in memory.
template <int kParts>
__m512i bytes_at(__m512i index, const uint8_t* table) {
  if (kParts == 1) return _mm512_permutexvar_epi8(index, register_at(table, 0));
  const __m512i two = _mm512_permutex2var_epi8(register_at(table, 0), index, register_at(table, 1));
  if (kParts == 2) return two;
  const __mmask64 beyond = _mm512_movepi8_mask(index);
  if (kParts == 3) return _mm512_mask_permutexvar_epi8(two, beyond, index, register_at(table, 2));
  return _mm512_mask_blend_epi8(
      beyond, two, _mm512_permutex2var_epi8(register_at(table, 2), index, register_at(table, 3)));
}

/// Returns bytes of the first register for the first eight of each sixteen, else of the second.
__m512i bytes_by_eights(__m512i index, __m512i first, __m512i second) {
  const __m512i in_second = _mm512_maskz_set1_epi8(kSecondEight, 64);
  return _mm512_permutex2var_epi8(first, _mm512_or_si512(index, in_second), second);
}

/// Returns bytes of a table of 256.
__m512i bytes_of(const __m512i (&table)[4], __m512i index) {
  return _mm512_mask_blend_epi8(_mm512_movepi8_mask(index),
                                _mm512_permutex2var_epi8(table[0], index, table[1]),
                                _mm512_permutex2var_epi8(table[2], index, table[3]));
}

__m512i words_of(const Pieces& pieces, __m512i light, __mmask32 high) {
  return _mm512_mask_blend_epi16(
      high, _mm512_permutex2var_epi16(pieces.low[0], _mm512_srli_epi16(light, 5), pieces.low[1]),
      _mm512_permutex2var_epi16(pieces.high[0], _mm512_srli_epi16(light, 9), pieces.high[1]));
}

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

/// Order of a run's subpixels in the lanes of a row: two subpixels that are four apart share a
/// double word, because their view numbers are computed in double words.
constexpr int kOrder[kRun] = {0, 4, 1, 5, 2, 6, 3, 7};

/// ColourTable is indexed by the colours that the rows' runs begin with, encoded as Quad::colours:
/// the colour of each lane, 0 to 2.
struct ColourTable {
  alignas(64) uint8_t lanes[256][kRegisterBytes];
};

constexpr ColourTable colour_table() {
  ColourTable table{};
  for (int colours = 0; colours < 256; ++colours)
    for (int r = 0; r < kRows; ++r)
      for (int n = 0; n < kRun; ++n) {
        const auto colour = static_cast<uint8_t>(((colours >> (2 * r) & 3) + kOrder[n]) % 3);
        table.lanes[colours][16 * r + n] = table.lanes[colours][16 * r + kRun + n] = colour;
      }
  return table;
}
constexpr ColourTable kColours = colour_table();

/// Views holds the view numbers of a record as words, a row per 128 bits, eight subpixels each.
struct Views {
  __m512i index;   ///< bytes: the lane among a pixel's codes
  __m512i weight;  ///< words
};

/// Returns the view numbers of four subpixels of each row, before they are clamped: those that are
/// `along` places from the first. The steps of a record hold the columns' bend in the upper word,
/// which the upper words of `along` multiply by zero.
__m512i numbers_of(const Terms& terms, __m512i first, __m512i along, __m512i steps) {
  const __m512i usual = _mm512_mullo_epi32(along, _mm512_set1_epi32(terms.view_step));
  return _mm512_dpwssd_epi32(_mm512_add_epi32(first, usual), along, steps);
}

template <bool kMixesViews>
Views views_of(const Terms& terms, const Quad& quad) {
  constexpr __mmask32 kUpperWords = 0xaaaaaaaa;
  constexpr int kFractionBits = kViewBits - kWeightBits;
  const __m512i by_row = _mm512_set_epi32(3, 3, 3, 3, 2, 2, 2, 2, 1, 1, 1, 1, 0, 0, 0, 0);
  const __m512i none = _mm512_setzero_si512(), most = _mm512_set1_epi32(terms.view_most);
  const __m512i first = _mm512_permutexvar_epi32(
      by_row, _mm512_castsi128_si512(_mm_loadu_si128(reinterpret_cast<const __m128i*>(quad.view))));
  int32_t steps;
  static_assert(offsetof(Quad, column_bend) == offsetof(Quad, view_step) + 2);
  __builtin_memcpy(&steps, &quad.view_step, sizeof steps);
  const auto numbers = [&](__m128i along) {
    return numbers_of(terms, first, _mm512_broadcast_i32x4(along), _mm512_set1_epi32(steps));
  };
  __m512i left = numbers(_mm_setr_epi32(0, 1, 2, 3)), right = numbers(_mm_setr_epi32(4, 5, 6, 7));
  left = _mm512_min_epi32(_mm512_max_epi32(left, none), most);
  right = _mm512_min_epi32(_mm512_max_epi32(right, none), most);

  // The number of a view's first lane: four times the view.
  const __m512i a =
      _mm512_and_si512(_mm512_mask_blend_epi16(kUpperWords, _mm512_srli_epi32(left, kViewBits - 2),
                                               _mm512_srli_epi32(right, kViewBits - 2 - 16)),
                       _mm512_set1_epi16(~3));
  const __m512i colour = _mm512_load_si512(kColours.lanes[quad.colours]);
  if (!kMixesViews) return {_mm512_add_epi8(_mm512_packus_epi16(a, a), colour), none};
  const __m512i b = _mm512_add_epi16(a, _mm512_set1_epi16(4));
  const __m512i weight =
      _mm512_and_si512(_mm512_mask_blend_epi16(kUpperWords, _mm512_srli_epi32(left, kFractionBits),
                                               _mm512_slli_epi32(right, 16 - kFractionBits)),
                       _mm512_set1_epi16(0x7fff));
  return {_mm512_add_epi8(_mm512_packus_epi16(a, b), colour), weight};
}

/// Returns the codes of a record that does not mix views: the left column, then the right one.
template <int kParts>
__m512i choose_columns(__m512i index, const uint8_t* pixel) {
  const uint8_t* const next = pixel + kParts * kRegisterBytes;
  if (kParts == 1) return bytes_by_eights(index, register_at(pixel, 0), register_at(next, 0));
  return _mm512_mask_blend_epi8(kSecondEight, bytes_at<kParts>(index, pixel),
                                bytes_at<kParts>(index, next));
}

/// Codes holds what a picture row contributes to a record: the two columns of both views, or, if
/// views are not mixed, both columns in one register.
template <bool kMixesViews>
struct Codes;
template <>
struct Codes<true> {
  __m512i left, right;
};
template <>
struct Codes<false> {
  __m512i both;
};

template <int kParts, bool kMixesViews>
Codes<kMixesViews> choose_codes(__m512i index, const uint8_t* pixel) {
  if constexpr (kMixesViews)
    return {bytes_at<kParts>(index, pixel),
            bytes_at<kParts>(index, pixel + kParts * kRegisterBytes)};
  else
    return {choose_columns<kParts>(index, pixel)};
}

Codes<true> blend(__mmask64 lanes, const Codes<true>& a, const Codes<true>& b) {
  return {_mm512_mask_blend_epi8(lanes, a.left, b.left),
          _mm512_mask_blend_epi8(lanes, a.right, b.right)};
}
Codes<false> blend(__mmask64 lanes, const Codes<false>& a, const Codes<false>& b) {
  return {_mm512_mask_blend_epi8(lanes, a.both, b.both)};
}

/// RowCodes holds the codes of a record's two picture rows.
template <bool kMixesViews>
struct RowCodes {
  Codes<kMixesViews> upper, lower;
};

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

/// Columns holds the columns of a record if its rows use one, or two neighbouring ones.
struct Columns {
  size_t least;
  __mmask64 next;   ///< lanes of the rows that use the column after the least
  bool neighbours;  ///< false if there are other columns
};

Columns columns_of(const Quad& quad) {
  uint64_t columns;
  static_assert(sizeof columns == sizeof quad.column);
  __builtin_memcpy(&columns, quad.column, sizeof columns);
  const uint64_t least =
      quad.column[0] < quad.column[kRows - 1] ? quad.column[0] : quad.column[kRows - 1];
  const uint64_t beyond = columns - least * 0x0001000100010001;
  return {least, beyond * 0xffff, (beyond & 0xfffefffefffefffe) == 0};
}

/// Chooses codes when the picture rows have a simple pattern, and the rows use one column or, if
/// kNext, two neighbouring ones.
template <int kParts, bool kMixesViews, bool kNext>
[[gnu::always_inline]] inline RowCodes<kMixesViews> choose_simply(const RowPattern& rows,
                                                                  const Columns& columns,
                                                                  __m512i index) {
  constexpr size_t kPixel = kParts * kRegisterBytes;
  const auto choose = [&](const uint8_t* row) __attribute__((always_inline)) {
    const uint8_t* const pixel = row + columns.least * kPixel;
    const auto codes = choose_codes<kParts, kMixesViews>(index, pixel);
    if constexpr (!kNext) return codes;
    return blend(columns.next, codes, choose_codes<kParts, kMixesViews>(index, pixel + kPixel));
  };
  const auto top = choose(rows.top), middle = choose(rows.middle);
  if (rows.last == 0) return {top, middle};
  const auto bottom = choose(rows.bottom);
  return {blend(rows.last, top, middle), blend(rows.last, middle, bottom)};
}

/// Chooses codes row by row; rows that use the same pixels are handled together.
template <int kParts, bool kMixesViews>
RowCodes<kMixesViews> choose_by_rows(const TransposedRows& rows, const Quad& quad, __m512i index) {
  RowCodes<kMixesViews> codes{};
  for (int begin = 0; begin < kRows;) {
    int end = begin + 1;
    while (end < kRows && quad.column[end] == quad.column[begin] &&
           rows.upper[end] == rows.upper[begin])
      ++end;
    const __mmask64 lanes = (~uint64_t{0} >> (64 - 16 * (end - begin))) << (16 * begin);
    const size_t pixel = quad.column[begin] * (kParts * kRegisterBytes);
    const auto* const upper = static_cast<const uint8_t*>(rows.upper[begin]) + pixel;
    const auto* const lower = static_cast<const uint8_t*>(rows.lower[begin]) + pixel;
    codes.upper = blend(lanes, codes.upper, choose_codes<kParts, kMixesViews>(index, upper));
    codes.lower = blend(lanes, codes.lower, choose_codes<kParts, kMixesViews>(index, lower));
    begin = end;
  }
  return codes;
}

/// Returns a + (b - a) weight, rounded.
__m512i mix(__m512i a, __m512i b, __m512i weight) {
  return _mm512_add_epi16(a, _mm512_mulhrs_epi16(_mm512_sub_epi16(b, a), weight));
}

/// Light holds the light of a register of codes: the first eight of each sixteen, and the others.
struct Light {
  __m512i a, b;
};

Light light_of(const LightTable& table, __m512i codes) {
  const __m512i low = bytes_of(table.low, codes);
  const __m512i high = bytes_of(table.high, codes);
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
  const __m512i along = _mm512_broadcast_i32x4(_mm_setr_epi16(0, 4, 1, 5, 2, 6, 3, 7));
  const __m512i step = _mm512_add_epi16(
      per_row(quad.column_step), _mm512_mullo_epi16(along, _mm512_set1_epi16(quad.column_bend)));
  const __m512i bend = _mm512_srai_epi16(_mm512_mullo_epi16(along, step), kSlopeBits);
  return _mm512_add_epi16(per_row(quad.share), bend);
}

/// Returns the light of a record.
__m512i mix_record(const LightTable& table, const RowCodes<true>& codes, __m512i row_weight,
                   __m512i column_weight, __m512i view_weight) {
  const auto light = [&](__m512i of) { return light_of(table, of); };
  const Light left = mix(light(codes.upper.left), light(codes.lower.left), row_weight);
  const Light right = mix(light(codes.upper.right), light(codes.lower.right), row_weight);
  const Light both_views = mix(left, right, column_weight);
  return mix(both_views.a, both_views.b, view_weight);
}
__m512i mix_record(const LightTable& table, const RowCodes<false>& codes, __m512i row_weight,
                   __m512i column_weight, __m512i /*view_weight*/) {
  const auto light = [&](__m512i of) { return light_of(table, of); };
  const Light columns = mix(light(codes.upper.both), light(codes.lower.both), row_weight);
  return mix(columns.a, columns.b, column_weight);
}

/// Records pass each step in batches: the steps of one record depend on each other, the steps of
/// several records do not, and a processor looks about a hundred instructions ahead.
constexpr uint32_t kBatch = 8;
template <bool kMixesViews>
struct Batch {
  Views views[kBatch];
  __m512i column_weight[kBatch];
  RowCodes<kMixesViews> codes[kBatch];
  __m512i light[kBatch];
};

/// A frame's records exceed the caches, so they are prefetched this far ahead.
constexpr uint32_t kQuadsAhead = 64;
void fetch_quads(const Quad* quads, uint32_t begin, uint32_t end) {
  for (uint32_t q = begin; q < begin + kBatch && q < end; ++q)
    _mm_prefetch(reinterpret_cast<const char*>(quads + q), _MM_HINT_T0);
}

template <int kParts, bool kMixesViews>
void choose_batch(const TransposedRows& rows, const Quad* quads, uint32_t count,
                  Batch<kMixesViews>& batch) {
  const RowPattern pattern = pattern_of(rows);
  for (uint32_t n = 0; n < count; ++n) {
    const __m512i index = batch.views[n].index;
    const Columns columns = columns_of(quads[n]);
    if (!pattern.simple || !columns.neighbours)
      batch.codes[n] = choose_by_rows<kParts, kMixesViews>(rows, quads[n], index);
    else if (columns.next == 0)
      batch.codes[n] = choose_simply<kParts, kMixesViews, false>(pattern, columns, index);
    else
      batch.codes[n] = choose_simply<kParts, kMixesViews, true>(pattern, columns, index);
  }
}

/// LaneTable holds the lanes of the four rows' subpixels, in their order along the rows.
struct LaneTable {
  alignas(64) uint8_t lanes[kRegisterBytes];
};
constexpr LaneTable lane_table() {
  LaneTable table{};
  for (int r = 0; r < kRows; ++r)
    for (int n = 0; n < kRun; ++n)
      table.lanes[kRun * r + kOrder[n]] = static_cast<uint8_t>(16 * r + 2 * n);
  return table;
}
constexpr LaneTable kFromOrder = lane_table();

/// CodeTable maps light to codes by the encoding curve.
struct CodeTable {
  Pieces start, rise;
};

CodeTable code_table(const int16_t* curve) {
  const auto part = [&](int n) { return _mm512_load_si512(curve + 32 * n); };
  return {.start = {{part(0), part(1)}, {part(4), part(5)}},
          .rise = {{part(2), part(3)}, {part(6), part(7)}}};
}

/// Returns the codes of 32 values of light, in the order along the rows.
__m256i codes_of(const CodeTable& table, __m512i light) {
  const __mmask32 high = _mm512_cmpge_epi16_mask(light, _mm512_set1_epi16(2048));
  const __m512i start = words_of(table.start, light, high);
  const __m512i rise = words_of(table.rise, light, high);
  const __m512i rest = _mm512_and_si512(
      _mm512_mask_blend_epi16(high, _mm512_slli_epi16(light, 10), _mm512_slli_epi16(light, 6)),
      _mm512_set1_epi16(0x7fff));
  const __m512i codes =
      _mm512_srli_epi16(_mm512_add_epi16(start, _mm512_mulhrs_epi16(rise, rest)), 7);
  return _mm512_castsi512_si256(
      _mm512_permutexvar_epi8(_mm512_load_si512(kFromOrder.lanes), codes));
}

void store_rows(__m256i codes, const Set& set, const Quad& quad, const Target& target) {
  uint8_t* const out = target.codes + set.first;
  const auto row = [&](int r) { return out + static_cast<size_t>(r) * target.stride + quad.at[r]; };
  const auto store_two = [](__m128i two, uint8_t* first, uint8_t* second) {
    _mm_storel_epi64(reinterpret_cast<__m128i*>(first), two);
    _mm_storeh_pd(reinterpret_cast<double*>(second), _mm_castsi128_pd(two));
  };
  store_two(_mm256_castsi256_si128(codes), row(0), row(1));
  store_two(_mm256_extracti128_si256(codes, 1), row(2), row(3));
}

/// Transposes sixteen by sixteen double words.
void transpose_16(__m512i (&rows)[16]) {
  __m512i pairs[16];
  for (int n = 0; n < 16; n += 2) {
    pairs[n] = _mm512_unpacklo_epi32(rows[n], rows[n + 1]);
    pairs[n + 1] = _mm512_unpackhi_epi32(rows[n], rows[n + 1]);
  }
  // Register 4 q + c: in its part p, the four rows from 4 q on at column 4 p + c.
  __m512i fours[16];
  for (int q = 0; q < 16; q += 4)
    for (int c = 0; c < 2; ++c) {
      fours[q + 2 * c] = _mm512_unpacklo_epi64(pairs[q + c], pairs[q + 2 + c]);
      fours[q + 2 * c + 1] = _mm512_unpackhi_epi64(pairs[q + c], pairs[q + 2 + c]);
    }
  for (int c = 0; c < 4; ++c) {
    const __m512i low_even = _mm512_shuffle_i32x4(fours[c], fours[4 + c], 0x88);
    const __m512i low_odd = _mm512_shuffle_i32x4(fours[c], fours[4 + c], 0xdd);
    const __m512i high_even = _mm512_shuffle_i32x4(fours[8 + c], fours[12 + c], 0x88);
    const __m512i high_odd = _mm512_shuffle_i32x4(fours[8 + c], fours[12 + c], 0xdd);
    rows[c] = _mm512_shuffle_i32x4(low_even, high_even, 0x88);
    rows[4 + c] = _mm512_shuffle_i32x4(low_odd, high_odd, 0x88);
    rows[8 + c] = _mm512_shuffle_i32x4(low_even, high_even, 0xdd);
    rows[12 + c] = _mm512_shuffle_i32x4(low_odd, high_odd, 0xdd);
  }
}

constexpr int kTile = 16;  ///< pixels that are transposed at once
constexpr size_t kTileBytes = 3 * kTile;
/// The hardware prefetcher does not follow so many rows at once, so they are prefetched explicitly.
constexpr size_t kAhead = 256;

/// Returns the bytes of three in each four of sixteen pixels, in the order of the places' colours.
__m512i colour_order(bool blue_first) {
  alignas(64) uint8_t from[kRegisterBytes];
  for (int byte = 0; byte < 64; ++byte) {
    const int colour = byte % 4 < 3 ? byte % 4 : 2;
    from[byte] = static_cast<uint8_t>(byte / 4 * 3 + (blue_first ? 2 - colour : colour));
  }
  return _mm512_load_si512(from);
}

/// Transposes sixteen pixels of at most sixteen views, which begin `at` bytes into the views.
void transpose_tile(const uint8_t* const* views, int count, size_t at, __m512i order, size_t stride,
                    uint8_t* transposed) {
  __m512i rows[kViewsPerRegister];
  for (int n = 0; n < kViewsPerRegister; ++n) {
    if (n >= count) {
      rows[n] = _mm512_setzero_si512();
      continue;
    }
    _mm_prefetch(reinterpret_cast<const char*>(views[n] + at + kAhead), _MM_HINT_T0);
    rows[n] = _mm512_permutexvar_epi8(
        order, _mm512_maskz_loadu_epi8((uint64_t{1} << kTileBytes) - 1, views[n] + at));
  }
  transpose_16(rows);
  for (size_t n = 0; n < kTile; ++n) _mm512_store_si512(transposed + n * stride, rows[n]);
}

/// Transposes the pixels of a row that fill no tile.
void transpose_rest(const Pictures& pictures, bool blue_first, size_t begin, int column,
                    size_t stride, uint8_t* transposed) {
  for (; column < pictures.width; ++column)
    for (int view = 0; view < pictures.views; ++view)
      for (int c = 0; c < 3; ++c)
        transposed[static_cast<size_t>(column) * stride + static_cast<size_t>(4 * view + c)] =
            pictures
                .first[view][begin + static_cast<size_t>(3 * column + (blue_first ? 2 - c : c))];
}

template <int kParts, bool kMixesViews>
void mix_set(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad* quads,
             const Target& target) {
  const LightTable table = light_table(terms.light);
  const CodeTable encoding = code_table(terms.curve);
  const __m512i row_weight = per_row(set.row_share);
  Batch<kMixesViews> batch;
  for (uint32_t q = set.quads_begin; q < set.quads_end; q += kBatch) {
    const uint32_t count = set.quads_end - q < kBatch ? set.quads_end - q : kBatch;
    fetch_quads(quads, q + kQuadsAhead, set.quads_end);
    for (uint32_t n = 0; n < count; ++n) {
      batch.views[n] = views_of<kMixesViews>(terms, quads[q + n]);
      batch.column_weight[n] = column_weights(quads[q + n]);
    }
    choose_batch<kParts>(rows, quads + q, count, batch);
    for (uint32_t n = 0; n < count; ++n)
      batch.light[n] = mix_record(table, batch.codes[n], row_weight, batch.column_weight[n],
                                  batch.views[n].weight);
    for (uint32_t n = 0; n < count; ++n)
      store_rows(codes_of(encoding, batch.light[n]), set, quads[q + n], target);
  }
}

}  // namespace

void transpose_row(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                   uint8_t* transposed) noexcept {
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t stride = 4 * lanes;
  const __m512i order = colour_order(terms.blue_first);
  int column = 0;
  for (; column + kTile <= pictures.width; column += kTile)
    for (int view = 0; view < pictures.views; view += kViewsPerRegister)
      transpose_tile(
          pictures.first + view, pictures.views - view, begin + 3 * static_cast<size_t>(column),
          order, stride,
          transposed + static_cast<size_t>(column) * stride + 4 * static_cast<size_t>(view));
  transpose_rest(pictures, terms.blue_first, begin, column, stride, transposed);
  uint8_t* const end = transposed + static_cast<size_t>(pictures.width) * stride;
  for (size_t at = 0; at < stride; at += kRegisterBytes)
    _mm512_store_si512(end + at, _mm512_load_si512(end - stride + at));
}

void mix_set_by_permuting(const Terms& terms, const TransposedRows& rows, const Set& set,
                          const Quad* quads, const Target& target) noexcept {
  lanes::with_constant<1, 4>(static_cast<int>(rows.lanes / kViewsPerRegister), [&](auto parts) {
    return terms.weight_mask != 0 ? mix_set<parts, true>(terms, rows, set, quads, target)
                                  : mix_set<parts, false>(terms, rows, set, quads, target);
  });
}

void stream_row(const uint8_t* codes, size_t count, uint8_t* to) noexcept {
  const bool aligned = reinterpret_cast<uintptr_t>(to) % kRegisterBytes == 0;
  const size_t whole = aligned ? count / kRegisterBytes * kRegisterBytes : 0;
  for (size_t at = 0; at < whole; at += kRegisterBytes)
    _mm512_stream_si512(reinterpret_cast<__m512i*>(to + at), _mm512_loadu_si512(codes + at));
  __builtin_memcpy(to + whole, codes + whole, count - whole);
}

void end_streaming() noexcept { _mm_sfence(); }

}  // namespace lenticule::frames::weave_kernel
