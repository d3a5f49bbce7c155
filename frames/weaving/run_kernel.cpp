// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic for a run of eight subpixels at once, one source for all instruction
// sets. It mixes transposed picture rows in linear light: eight bytes of a subpixel's upper and of
// its lower picture row hold the light of two views in two columns. Loads of eight bytes are about
// equally fast on all processors, gathers are not.
//
// Vectors are as wide as a register. Everything happens within lanes of 16 bytes: a register of
// AVX2 has two lanes, every other register one. Lane k of a run of eight subpixels holds
// subpixels 4 k to 4 k + 3; the two lanes are one register with AVX2, otherwise two: its parts. A
// run is mixed in three steps:
//    rows     entries of the upper and the lower row
//    columns  the pairs of columns of each view
//    views    the pairs of views of each subpixel
// Column weights may be 2^15, which does not fit into 16 bits with a sign: they are used negated,
// or as the pair of weights w - 2^15 and -w for a difference of 2^14 and a sum of two products.
//
// Only products, mixes of neighbours, packing, and the look-up of bytes need the instructions of a
// processor; the functions for these come first.
#include <bit>
#include <cstring>
#include <utility>

#include "base/lanes.h"
#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::LENTICULE_ISA_NAMESPACE {
namespace {

using namespace weave_kernel;
using lanes::Vector;
using lanes::vector_at;

#if defined(__AVX2__)
constexpr int kLanes = 2;  ///< lanes of a register
#else
constexpr int kLanes = 1;
#endif
constexpr int kParts = 2 / kLanes;       ///< registers of words of a run
constexpr int kPartRun = kRun / kParts;  ///< subpixels of a part
constexpr int kPlaces = 16 * kLanes;     ///< bytes of a register

using Words = Vector<int32_t, 4 * kLanes>;
using Shorts = Vector<int16_t, 8 * kLanes>;
using LightWords = Vector<uint16_t, 8 * kLanes>;
using Bytes = Vector<uint8_t, kPlaces>;
using RunLight = Vector<int16_t, kRun>;

// --- instructions

/// Returns the source of element i of interleaved halves of the lanes of two vectors.
constexpr int zip_source(int count, bool high, int i) {
  const int in_lane = count / kLanes, element = i / in_lane * in_lane + i % in_lane / 2;
  return (i % 2) * count + element + (high ? in_lane / 2 : 0);
}
template <bool kHigh, class V, int... i>
inline V zipped(const V& a, const V& b, std::integer_sequence<int, i...> /*places*/) {
  return __builtin_shufflevector(a, b, zip_source(sizeof...(i), kHigh, i)...);
}
/// Interleaves the elements of the lower, or of the upper, halves of all lanes.
template <class V>
inline V zip_low(const V& a, const V& b) {
  return zipped<false>(a, b, std::make_integer_sequence<int, sizeof(V) / sizeof(a[0])>());
}
template <class V>
inline V zip_high(const V& a, const V& b) {
  return zipped<true>(a, b, std::make_integer_sequence<int, sizeof(V) / sizeof(a[0])>());
}

#if defined(__AVX2__)

/// Returns (a b + 2^14) >> 15.
inline Shorts rounded_product(const Shorts& a, const Shorts& b) {
  return reinterpret_cast<Shorts>(
      _mm256_mulhrs_epi16(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
}
/// Returns the sums of the products of two neighbours.
inline Words pair_sums(const Shorts& a, const Shorts& b) {
  return reinterpret_cast<Words>(
      _mm256_madd_epi16(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
}
/// Returns the words of `a`, then those of `b`, in each lane.
inline Shorts packed(const Words& a, const Words& b) {
  return reinterpret_cast<Shorts>(
      _mm256_packs_epi32(reinterpret_cast<__m256i>(a), reinterpret_cast<__m256i>(b)));
}
/// Returns the elements of a table of sixteen bytes.
inline Bytes looked_up(const uint8_t* table, const Bytes& at) {
  const __m128i points = _mm_load_si128(reinterpret_cast<const __m128i*>(table));
  return reinterpret_cast<Bytes>(
      _mm256_shuffle_epi8(_mm256_broadcastsi128_si256(points), reinterpret_cast<__m256i>(at)));
}

#else

#if defined(LENTICULE_NEON)

inline Shorts rounded_product(const Shorts& a, const Shorts& b) {
  return reinterpret_cast<Shorts>(
      vqrdmulhq_s16(reinterpret_cast<int16x8_t>(a), reinterpret_cast<int16x8_t>(b)));
}
inline Words pair_sums(const Shorts& a, const Shorts& b) {
  const auto x = reinterpret_cast<int16x8_t>(a), y = reinterpret_cast<int16x8_t>(b);
  return reinterpret_cast<Words>(
      vpaddq_s32(vmull_s16(vget_low_s16(x), vget_low_s16(y)), vmull_high_s16(x, y)));
}
inline Bytes looked_up(const uint8_t* table, const Bytes& at) {
  return reinterpret_cast<Bytes>(vqtbl1q_u8(vld1q_u8(table), reinterpret_cast<uint8x16_t>(at)));
}

#else

inline Shorts rounded_product(const Shorts& a, const Shorts& b) {
  using Wide = Vector<int32_t, 8>;
  const Wide product = __builtin_convertvector(a, Wide) * __builtin_convertvector(b, Wide);
  return __builtin_convertvector((product + (1 << 14)) >> 15, Shorts);
}
/// Returns the first, or the second, of two neighbours.
inline Words first_of_pairs(const Words& pairs) {
  return std::endian::native == std::endian::little ? (pairs << 16) >> 16 : pairs >> 16;
}
inline Words second_of_pairs(const Words& pairs) {
  return std::endian::native == std::endian::little ? pairs >> 16 : (pairs << 16) >> 16;
}
inline Words pair_sums(const Shorts& a, const Shorts& b) {
  const auto x = reinterpret_cast<Words>(a), y = reinterpret_cast<Words>(b);
  return first_of_pairs(x) * first_of_pairs(y) + second_of_pairs(x) * second_of_pairs(y);
}

#endif

inline Shorts packed(const Words& a, const Words& b) {
  constexpr int kLow = std::endian::native == std::endian::little ? 0 : 1;
  return __builtin_shufflevector(reinterpret_cast<Shorts>(a), reinterpret_cast<Shorts>(b), kLow,
                                 kLow + 2, kLow + 4, kLow + 6, kLow + 8, kLow + 10, kLow + 12,
                                 kLow + 14);
}

#endif

// --- mixing two views

/// Returns the weights for mix_pairs() in 32 bits, from weights that are each in two neighbours.
inline Shorts pair_weights(const Shorts& weight) {
  const Shorts negated = zip_low(Shorts{}, Shorts{} - 1);
  const Shorts added = zip_low(Shorts{} + INT16_MIN, Shorts{} + 1);
  // without a sign, because a signed sum must not overflow
  return reinterpret_cast<Shorts>(reinterpret_cast<LightWords>(weight ^ negated) +
                                  reinterpret_cast<LightWords>(added));
}
inline Words mix_pairs(const Shorts& pairs, const Shorts& weights) {
  return ((1 << (kWeightBits - 1)) - pair_sums(pairs, weights)) >> kWeightBits;
}

#if defined(LENTICULE_NEON)

/// Mixes the pairs of `a`, then those of `b`, in each lane; the weights are in the order of the
/// results.
inline Shorts mix_neighbours(const Shorts& a, const Shorts& b, const Shorts& weights) {
  const auto x = reinterpret_cast<int16x8_t>(a), y = reinterpret_cast<int16x8_t>(b);
  const int16x8_t first = vuzp1q_s16(x, y), rise = vsubq_s16(vuzp2q_s16(x, y), first);
  const int16x8_t negative = vnegq_s16(reinterpret_cast<int16x8_t>(weights));
  const int32x4_t half = vdupq_n_s32(1 << (kWeightBits - 1));
  const int32x4_t low = vmlsl_s16(half, vget_low_s16(rise), vget_low_s16(negative));
  const int32x4_t high = vmlsl_high_s16(half, rise, negative);
  return reinterpret_cast<Shorts>(
      vaddq_s16(first, vshrn_high_n_s32(vshrn_n_s32(low, kWeightBits), high, kWeightBits)));
}

#else

inline Shorts mix_neighbours(const Shorts& a, const Shorts& b, const Shorts& weights) {
  const Shorts rest = weights ^ INT16_MIN, negative = -weights;
  return packed(mix_pairs(a, zip_low(rest, negative)), mix_pairs(b, zip_high(rest, negative)));
}

#endif

/// Mixes the pairs of all parts.
inline RunLight mix_views(const Shorts (&pairs)[kParts], const Words (&weights)[kParts]) {
#if defined(__AVX2__)
  const Shorts both = reinterpret_cast<Shorts>(weights[0] | weights[0] << 16);
  const auto light = reinterpret_cast<__m256i>(mix_pairs(pairs[0], pair_weights(both)));
  return reinterpret_cast<RunLight>(
      _mm_packs_epi32(_mm256_castsi256_si128(light), _mm256_extracti128_si256(light, 1)));
#else
  return mix_neighbours(pairs[0], pairs[1], packed(weights[0], weights[1]));
#endif
}

/// Returns a + (b - a) weight, rounded; the weight is below 2^15.
inline Shorts mix(const Shorts& a, const Shorts& b, const Shorts& weight) {
  return a + rounded_product(b - a, weight);
}

/// RunTerms holds the values that are constant for all records of a set.
struct RunTerms {
  /// Subpixels of a stripe are adjacent; subpixels of a single colour are a stride apart.
  explicit RunTerms(const Terms& terms, const TransposedRows& rows, const Set& set,
                    const Target& target)
      : view_most(terms.view_most),
        weight_mask(terms.weight_mask),
        column_bytes(3 * rows.lanes * 4) {
    for (int n = 0; n < kRun; ++n) {
      const int part = n / kPartRun, at = n % kPartRun;
      along[part][at] = n;
      along_pairs[part][2 * at] = along_pairs[part][2 * at + 1] = static_cast<int16_t>(n);
      for (uint32_t begin = 0; begin < 4; ++begin) {
        const uint32_t colour =
            (set.first + (set.stride == 1 ? begin + static_cast<uint32_t>(n) : 0)) % 3;
        colours[begin][part][at] =
            static_cast<int32_t>((terms.blue_first ? 2 - colour : colour) * rows.lanes * 4);
      }
    }
    for (int r = 0; r < kRows; ++r) {
      row_weight[r] = Shorts{} + set.row_share[r];
      upper[r] = static_cast<const uint8_t*>(rows.upper[r]);
      lower[r] = static_cast<const uint8_t*>(rows.lower[r]);
      out[r] = target.light + static_cast<size_t>(r) * target.stride + set.first;
    }
  }

  int32_t view_most, weight_mask;
  Words along[kParts];         ///< numbers of the subpixels of each part
  Shorts along_pairs[kParts];  ///< each of them twice
  /// Byte offsets to the subpixels' colours, by the first one's colour.
  Words colours[4][kParts];
  Shorts row_weight[kRows];
  const uint8_t* upper[kRows];
  const uint8_t* lower[kRows];
  uint16_t* out[kRows];  ///< place 0
  size_t column_bytes;
};

/// Loads the entries of subpixels n and n + 1 of each lane.
inline Shorts two_entries(const uint8_t* row, const uint32_t* offset) {
  Vector<uint64_t, 2 * kLanes> entries;
  for (int lane = 0; lane < kLanes; ++lane)
    for (int n = 0; n < 2; ++n)
      std::memcpy(&reinterpret_cast<uint64_t*>(&entries)[2 * lane + n], row + offset[4 * lane + n],
                  sizeof(uint64_t));
  return reinterpret_cast<Shorts>(entries);
}

/// Part holds the inputs of mixing a part of a run, except the light.
struct Part {
  Words offsets;  ///< bytes from the pixel to the entries of its subpixels
  Words view_weights;
  Shorts column_weights;
};

/// Batch holds the runs of some records. They pass each step together: the steps of one run depend
/// on each other, those of several runs do not, and a processor looks only two runs ahead.
constexpr uint32_t kBatch = 4;
struct Batch {
  Part parts[kBatch * kRows][kParts];
  const uint8_t* upper[kBatch * kRows];  ///< pixels
  const uint8_t* lower[kBatch * kRows];
  uint16_t* out[kBatch * kRows];
  const Shorts* row_weight[kBatch * kRows];
  int counts[kBatch * kRows];
  int runs;
};

/// Adds the runs of a record to a batch.
[[gnu::always_inline]] inline void look(const RunTerms& run, int32_t step, size_t stride,
                                        const Quad& quad, Batch& batch) {
  Words steps[kParts];
  for (int part = 0; part < kParts; ++part) steps[part] = run.along[part] * (step + quad.view_step);
  for (int r = 0; r < kRows; ++r) {
    const int count = (quad.counts >> (4 * r)) & 15, at = batch.runs;
    if (count == 0) continue;
    const size_t pixel = quad.column[r] * run.column_bytes;
    batch.upper[at] = run.upper[r] + pixel;
    batch.lower[at] = run.lower[r] + pixel;
    batch.out[at] = run.out[r] + quad.at[r] * stride;
    batch.row_weight[at] = &run.row_weight[r];
    batch.counts[at] = count;
    ++batch.runs;
    for (int part = 0; part < kParts; ++part) {
      Part& to = batch.parts[at][part];
      Words number = quad.view[r] + steps[part];
      number = number < 0 ? Words{} : number;
      number = number > run.view_most ? Words{} + run.view_most : number;
      to.view_weights = (number >> (kViewBits - kWeightBits)) & run.weight_mask;
      to.offsets = ((number >> kViewBits) << 2) + run.colours[(quad.colours >> (2 * r)) & 3][part];
      const Shorts& along = run.along_pairs[part];
      const Shorts moved = along * (quad.column_step[r] + along * quad.column_bend);
      to.column_weights = static_cast<int16_t>(quad.share[r]) + (moved >> kSlopeBits);
    }
  }
}

/// Mixes rows and columns of a part: returns the light of its subpixels' two views.
[[gnu::always_inline]] inline Shorts mix_part(const Batch& batch, int at, int part) {
  const Part& from = batch.parts[at][part];
  const auto* const offset = reinterpret_cast<const uint32_t*>(&from.offsets);
  const Shorts& row_weight = *batch.row_weight[at];
  const auto rows = [&](int n) {
    return mix(two_entries(batch.upper[at], offset + n), two_entries(batch.lower[at], offset + n),
               row_weight);
  };
  return mix_neighbours(rows(0), rows(2), from.column_weights);
}

template <bool kStripes>
inline void mix_batch(const Batch& batch, size_t stride) {
  for (int at = 0; at < batch.runs; ++at) {
    Shorts views[kParts];
    Words weights[kParts];
    for (int part = 0; part < kParts; ++part) {
      views[part] = mix_part(batch, at, part);
      weights[part] = batch.parts[at][part].view_weights;
    }
    const RunLight light = mix_views(views, weights);
    if (kStripes) {
      vector_at<RunLight>(batch.out[at]).v = light;
    } else {
      alignas(16) uint16_t words[kRun];
      vector_at<RunLight>(words).v = light;
      for (int n = 0; n < batch.counts[at]; ++n)
        batch.out[at][static_cast<size_t>(n) * stride] = words[n];
    }
  }
}

/// A frame's records exceed the caches, so they are prefetched this far ahead.
constexpr uint32_t kQuadsAhead = 32;

template <bool kStripes>
void mix_quads(const RunTerms& run, const Terms& terms, const Set& set, const Quad* quads) {
  Batch batch;
  for (uint32_t q = set.quads_begin; q < set.quads_end; q += kBatch) {
    const uint32_t end = set.quads_end - q < kBatch ? set.quads_end : q + kBatch;
    batch.runs = 0;
    for (uint32_t n = q; n < end; ++n) {
      __builtin_prefetch(quads + n + kQuadsAhead);
      look(run, terms.view_step, set.stride, quads[n], batch);
    }
    mix_batch<kStripes>(batch, set.stride);
  }
}

// --- the Gaussian view filter: one subpixel after the other, a register of its views at once

constexpr int kViewsAtOnce = 4 * kLanes;

/// Returns the light of views from `view` on, 32 bits each.
inline Words views_light(const Shorts& upper, const Shorts& lower, const Shorts& row_weight,
                         const Shorts& column_weights) {
  return mix_pairs(mix(upper, lower, row_weight), column_weights);
}

inline int64_t sum_of(const Words& v) {
  Vector<int32_t, 4> four = __builtin_shufflevector(v, v, 0, 1, 2, 3);
  if (kLanes == 2) four += __builtin_shufflevector(v, v, 4, 5, 6, 7);
  const Vector<int32_t, 4> two = four + __builtin_shufflevector(four, four, 2, 3, 0, 1);
  return two[0] + two[1];
}

/// Look holds the inputs of a subpixel: the first entries of its pixel and colour, and the weights
/// of rows and columns.
struct Look {
  const uint16_t *upper, *lower;
  Shorts row_weight, column_weights;
};

/// Returns a subpixel's light under the spot. A product has 31 bits, so its halves are summed
/// separately.
uint16_t spot_light(const Spot& spot, const Look& look, int32_t number) {
  const int part = (number & ((1 << kViewBits) - 1)) >> (kViewBits - spot.bits);
  const uint16_t* const weights = spot.weights + static_cast<ptrdiff_t>(part) * spot.taps;
  const int first = (number >> kViewBits) - spot.reach;
  const int end = spot.taps < spot.views - first ? spot.taps : spot.views - first;
  Words along;
  for (int lane = 0; lane < kViewsAtOnce; ++lane) along[lane] = lane;
  Words low{}, high{}, sum{};
  for (int n = first < 0 ? -first : 0; n < end; n += kViewsAtOnce) {
    using Weights = Vector<uint16_t, kViewsAtOnce>;
    const Words read = __builtin_convertvector(vector_at<Weights>(weights + n).v, Words);
    const Words weight = read & (along < end - n);
    const auto at = [&](const uint16_t* entries) {
      return vector_at<Shorts>(entries + 2 * (first + n)).v;
    };
    const Words product =
        views_light(at(look.upper), at(look.lower), look.row_weight, look.column_weights) * weight;
    low += product & 0xffff;
    high += product >> 16;
    sum += weight;
  }
  const int64_t all = sum_of(sum), light = (sum_of(high) << 16) + sum_of(low);
  return all > 0 ? static_cast<uint16_t>((light + all / 2) / all) : uint16_t{0};
}

/// Mixes one row of a record.
void mix_spot_run(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad& quad,
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
                    static_cast<const uint16_t*>(rows.lower[r]) + at, Shorts{} + set.row_share[r],
                    pair_weights(Shorts{} + static_cast<int16_t>(quad.share[r] + bend))};
    light[place] = spot_light(terms.spot, look, quad.view[r] + n * step);
  }
}

void mix_set(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad* quads,
             const Target& target) noexcept {
  if (terms.spot.weights != nullptr) {
    for (uint32_t q = set.quads_begin; q < set.quads_end; ++q)
      for (int r = 0; r < kRows; ++r)
        mix_spot_run(terms, rows, set, quads[q], r,
                     target.light + static_cast<size_t>(r) * target.stride);
    return;
  }
  const RunTerms run(terms, rows, set, target);
  set.stride == 1 ? mix_quads<true>(run, terms, set, quads)
                  : mix_quads<false>(run, terms, set, quads);
}

// --- transposing: sixteen views at a time

constexpr int kTile = 32;  ///< bytes of each view that are transposed at once

/// Tile holds the light of sixteen views, in the order of view_in_lane(), at kTile places.
struct Tile {
  alignas(32) uint16_t light[kTile][kLaneStep];
};

/// Returns the view of a place in a row of a tile, such that joining two columns sorts the views.
constexpr int view_in_lane(int n) {
  return kLanes == 1 || n / 4 == 0 || n / 4 == 3 ? n : 12 - n / 4 * 4 + n % 4;
}

/// Transposes sixteen times sixteen bytes in each lane.
inline void transpose_16(Bytes (&rows)[16]) {
  for (int round = 0; round < 4; ++round) {
    Bytes next[16];
    for (int n = 0; n < 8; ++n) {
      next[2 * n] = zip_low(rows[n], rows[n + 8]);
      next[2 * n + 1] = zip_high(rows[n], rows[n + 8]);
    }
    for (int n = 0; n < 16; ++n) rows[n] = next[n];
  }
}

#if defined(__AVX2__) || defined(LENTICULE_NEON)

/// Evaluates the curve: start + ((t (rise + (t bend + 4 >> 3)) + 4) >> 3).
inline LightWords along_curve(const LightWords& t, const LightWords& start, const LightWords& rise,
                              const LightWords& bend) {
  return start + ((t * (rise + ((t * bend + 4) >> 3)) + 4) >> 3);
}

/// Writes the light of the codes of sixteen views: lane k is place n + 16 k of the tile.
inline void write_light(const Terms& terms, const Bytes& codes, int n, Tile& tile) {
  const uint8_t* const points = terms.light_curve;
  const Bytes at = codes >> 4, t = codes & 15;
  const Bytes start_low = looked_up(points, at), start_high = looked_up(points + 16, at);
  const Bytes rise_low = looked_up(points + 32, at), rise_high = looked_up(points + 48, at);
  const Bytes bend = looked_up(points + 64, at);
  const auto words = [](const Bytes& bytes) { return reinterpret_cast<LightWords>(bytes); };
  const LightWords low =
      along_curve(words(zip_low(t, Bytes{})), words(zip_low(start_low, start_high)),
                  words(zip_low(rise_low, rise_high)), words(zip_low(bend, Bytes{})));
  const LightWords high =
      along_curve(words(zip_high(t, Bytes{})), words(zip_high(start_low, start_high)),
                  words(zip_high(rise_low, rise_high)), words(zip_high(bend, Bytes{})));
#if defined(__AVX2__)
  vector_at<LightWords>(tile.light[n]).v =
      __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23);
  vector_at<LightWords>(tile.light[16 + n]).v = __builtin_shufflevector(
      low, high, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26, 27, 28, 29, 30, 31);
#else
  vector_at<LightWords>(tile.light[n]).v = low;
  vector_at<LightWords>(tile.light[n] + 8).v = high;
#endif
}

#else

inline void write_light(const Terms& terms, const Bytes& codes, int n, Tile& tile) {
  for (int view = 0; view < 16; ++view) tile.light[n][view] = terms.light[codes[view]];
}

#endif

inline void turn_tile(const Terms& terms, const uint8_t* const* views, size_t at, Tile& tile) {
  for (int begin = 0; begin < kTile; begin += kPlaces) {
    Bytes rows[16];
    for (int n = 0; n < 16; ++n) rows[n] = vector_at<Bytes>(views[view_in_lane(n)] + at + begin).v;
    transpose_16(rows);
    for (int n = 0; n < 16; ++n) write_light(terms, rows[n], begin + n, tile);
  }
}

/// Transposes fewer bytes than a tile has, without reading behind them.
void turn_rest(const Terms& terms, const uint8_t* const* views, size_t at, size_t bytes,
               Tile& tile) {
  uint8_t codes[kLaneStep][kTile] = {};
  const uint8_t* rows[kLaneStep];
  for (size_t view = 0; view < kLaneStep; ++view) {
    for (size_t n = 0; n < bytes; ++n) codes[view][n] = views[view][at + n];
    rows[view] = codes[view];
  }
  turn_tile(terms, rows, 0, tile);
}

/// Stores one entry of sixteen views from the light of two columns.
inline void store_entries(const uint16_t* here, const uint16_t* next, uint16_t* entries) {
  for (size_t n = 0; n < kLaneStep; n += 8 * kLanes) {
    const LightWords a = vector_at<LightWords>(here + n).v, b = vector_at<LightWords>(next + n).v;
    vector_at<LightWords>(entries + 2 * n).v = zip_low(a, b);
    vector_at<LightWords>(entries + 2 * n + 8 * kLanes).v = zip_high(a, b);
  }
}

/// Transposes a tile of sixteen views' rows, which begin at `begin` and have `bytes`. The next tile
/// begins with the last three places of this tile, whose next columns that tile knows; only the
/// places of the last column have no next column.
inline void turn_views(const Terms& terms, const uint8_t* const* views, size_t begin, size_t at,
                       size_t bytes, size_t lanes, uint16_t* light) {
  const size_t count = bytes - at < kTile ? bytes - at : kTile, entry = 2 * lanes;
  Tile tile;
  if (count == kTile) {
    turn_tile(terms, views, begin + at, tile);
  } else {
    turn_rest(terms, views, begin + at, count, tile);
  }
  for (size_t n = 0; n + 3 < count; ++n)
    store_entries(tile.light[n], tile.light[n + 3], light + (at + n) * entry);
  if (at + count < bytes) return;
  for (size_t n = count - 3; n < count; ++n)
    store_entries(tile.light[n], tile.light[n], light + (at + n) * entry);
}

/// The hardware prefetcher does not follow so many rows at once, so they are prefetched explicitly.
constexpr size_t kAhead = 512;

void turn_light(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                uint16_t* light) noexcept {
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t bytes = 3 * static_cast<size_t>(pictures.width);
  for (size_t at = 0; at + 3 < bytes || at == 0; at += kTile - 3) {
    for (size_t view = 0; view < lanes; view += kLaneStep) {
      const uint8_t* const* const views = pictures.first + view;
      for (size_t n = 0; n < kLaneStep; ++n) __builtin_prefetch(views[n] + begin + at + kAhead);
      turn_views(terms, views, begin, at, bytes, lanes, light + 2 * view);
    }
  }
}

}  // namespace

extern const RunKernel kRunKernel;
const RunKernel kRunKernel{.turn_light = turn_light, .mix_set = mix_set};

}  // namespace lenticule::frames::LENTICULE_ISA_NAMESPACE
