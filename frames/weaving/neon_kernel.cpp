// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic for a run of eight subpixels at once, with NEON. As in
// avx2_kernel.cpp, eight bytes of a subpixel's upper and of its lower picture row hold the light of
// two views in two columns.
#include <arm_neon.h>

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

constexpr int16_t kAlong[kRun] = {0, 1, 2, 3, 4, 5, 6, 7};

/// RunTerms holds the values that are constant for all records of a set.
struct RunTerms {
  explicit RunTerms(const Terms& terms, const TransposedRows& rows, const Set& set,
                    const Target& target);

  int32x4_t view_most, weight_mask;
  uint32_t colours[4][kRun];  ///< offsets to the subpixels' colours in words, by the first's colour
  int16x8_t row_weight[kRows];
  const uint16_t* upper[kRows];
  const uint16_t* lower[kRows];
  uint16_t* out[kRows];  ///< place 0
  size_t column_words;
};

/// Subpixels of a stripe are adjacent; subpixels of a single colour are a stride apart.
RunTerms::RunTerms(const Terms& terms, const TransposedRows& rows, const Set& set,
                   const Target& target)
    : view_most(vdupq_n_s32(terms.view_most)),
      weight_mask(vdupq_n_s32(terms.weight_mask)),
      column_words(3 * rows.lanes * 2) {
  for (uint32_t begin = 0; begin < 4; ++begin)
    for (uint32_t n = 0; n < kRun; ++n) {
      const uint32_t colour = (set.first + (set.stride == 1 ? begin + n : 0)) % 3;
      colours[begin][n] =
          static_cast<uint32_t>((terms.blue_first ? 2 - colour : colour) * rows.lanes * 2);
    }
  for (int r = 0; r < kRows; ++r) {
    row_weight[r] = vdupq_n_s16(static_cast<int16_t>(set.row_share[r]));
    upper[r] = static_cast<const uint16_t*>(rows.upper[r]);
    lower[r] = static_cast<const uint16_t*>(rows.lower[r]);
    out[r] = target.light + static_cast<size_t>(r) * target.stride + set.first;
  }
}

/// Returns a + (b - a) weight, rounded; the weight is below 2^15.
int16x8_t mix(int16x8_t a, int16x8_t b, int16x8_t weight) {
  return vaddq_s16(a, vqrdmulhq_s16(vsubq_s16(b, a), weight));
}

/// Does the same for a weight of up to 2^15, which only fits negated.
int16x8_t mix_negated(int16x8_t a, int16x8_t b, int16x8_t negative_weight) {
  const int16x8_t rise = vsubq_s16(b, a);
  const int32x4_t half = vdupq_n_s32(1 << (kWeightBits - 1));
  const int32x4_t low = vmlsl_s16(half, vget_low_s16(rise), vget_low_s16(negative_weight));
  const int32x4_t high = vmlsl_high_s16(half, rise, negative_weight);
  return vaddq_s16(a, vshrn_high_n_s32(vshrn_n_s32(low, kWeightBits), high, kWeightBits));
}

/// Views holds the views of eight subpixels.
struct Views {
  uint32_t offset[kRun];  ///< words to the first view's entry
  int16x8_t weight;       ///< weight of the second view
};

/// Computes the views of a run; `numbers` are the view numbers of its first and last four
/// subpixels.
Views views_of(const RunTerms& run, const int32x4_t (&numbers)[2], const uint32_t* colours) {
  Views views;
  int16x4_t weight[2];
  for (int half = 0; half < 2; ++half) {
    const int32x4_t number = vminq_s32(vmaxq_s32(numbers[half], vdupq_n_s32(0)), run.view_most);
    const int32x4_t words = vshlq_n_s32(vshrq_n_s32(number, kViewBits), 1);
    vst1q_u32(views.offset + 4 * half,
              vaddq_u32(vreinterpretq_u32_s32(words), vld1q_u32(colours + 4 * half)));
    weight[half] =
        vmovn_s32(vandq_s32(vshrq_n_s32(number, kViewBits - kWeightBits), run.weight_mask));
  }
  views.weight = vcombine_s16(weight[0], weight[1]);
  return views;
}

/// Returns the negated column weights of a run.
int16x8_t negative_columns_of(const Quad& quad, int r) {
  const int16x8_t along = vld1q_s16(kAlong);
  const int16x8_t slope = vmlaq_n_s16(vdupq_n_s16(quad.column_step[r]), along, quad.column_bend);
  const int16x8_t bent = vshrq_n_s16(vmulq_s16(along, slope), kSlopeBits);
  return vnegq_s16(vaddq_s16(vdupq_n_s16(static_cast<int16_t>(quad.share[r])), bent));
}

int16x8_t two_entries(const uint16_t* row, const uint32_t* offset) {
  return vreinterpretq_s16_u16(vcombine_u16(vld1_u16(row + offset[0]), vld1_u16(row + offset[1])));
}

/// Mixes one row of a record.
int16x8_t mixed_run(const RunTerms& run, const Quad& quad, int r, const int32x4_t (&steps)[2]) {
  const int32x4_t first = vdupq_n_s32(quad.view[r]);
  const Views views = views_of(run, {vaddq_s32(first, steps[0]), vaddq_s32(first, steps[1])},
                               run.colours[(quad.colours >> (2 * r)) & 3]);
  const size_t pixel = quad.column[r] * run.column_words;
  const uint16_t *const upper = run.upper[r] + pixel, *const lower = run.lower[r] + pixel;
  int16x8_t entries[4];  // of two subpixels: two views in two columns
  for (int n = 0; n < 4; ++n)
    entries[n] = mix(two_entries(upper, views.offset + 2 * n),
                     two_entries(lower, views.offset + 2 * n), run.row_weight[r]);
  const int16x8_t here[2] = {vuzp1q_s16(entries[0], entries[1]),
                             vuzp1q_s16(entries[2], entries[3])};
  const int16x8_t next[2] = {vuzp2q_s16(entries[0], entries[1]),
                             vuzp2q_s16(entries[2], entries[3])};
  const int16x8_t columns = negative_columns_of(quad, r);
  return mix(mix_negated(vuzp1q_s16(here[0], here[1]), vuzp1q_s16(next[0], next[1]), columns),
             mix_negated(vuzp2q_s16(here[0], here[1]), vuzp2q_s16(next[0], next[1]), columns),
             views.weight);
}

/// Stores runs of a single colour, which have gaps.
void store_apart(uint16x8_t light, size_t stride, int count, uint16_t* first) {
  uint16_t words[kRun];
  vst1q_u16(words, light);
  for (int n = 0; n < count; ++n) first[static_cast<size_t>(n) * stride] = words[n];
}

void mix_quad(const RunTerms& run, const Terms& terms, size_t stride, const Quad& quad) {
  const int16x8_t along = vld1q_s16(kAlong);
  const int32_t step = terms.view_step + quad.view_step;
  const int32x4_t steps[2] = {vmulq_n_s32(vmovl_s16(vget_low_s16(along)), step),
                              vmulq_n_s32(vmovl_high_s16(along), step)};
  for (int r = 0; r < kRows; ++r) {
    const int count = (quad.counts >> (4 * r)) & 15;
    if (count == 0) continue;
    const uint16x8_t light = vreinterpretq_u16_s16(mixed_run(run, quad, r, steps));
    if (stride == 1) {
      vst1q_u16(run.out[r] + quad.at[r], light);
    } else {
      store_apart(light, stride, count, run.out[r] + quad.at[r] * stride);
    }
  }
}

/// A frame's records exceed the caches, so they are prefetched this far ahead.
constexpr uint32_t kQuadsAhead = 16;

constexpr size_t kPart = 16;  ///< bytes of each view that are transposed at once
constexpr size_t kTile = 32;  ///< places of a tile

/// Tile holds the light of sixteen views at kTile places.
struct Tile {
  uint16_t light[kTile][kLaneStep];
};

void transpose_16(uint8x16_t (&rows)[16]) {
  for (int round = 0; round < 4; ++round) {
    uint8x16_t next[16];
    for (int n = 0; n < 8; ++n) {
      next[2 * n] = vzip1q_u8(rows[n], rows[n + 8]);
      next[2 * n + 1] = vzip2q_u8(rows[n], rows[n + 8]);
    }
    for (int n = 0; n < 16; ++n) rows[n] = next[n];
  }
}

/// Evaluates the curve: start + ((t (rise + (t bend + 4 >> 3)) + 4) >> 3).
uint16x8_t along_curve(uint16x8_t t, uint16x8_t start, uint16x8_t rise, uint16x8_t bend) {
  const uint16x8_t slope = vaddq_u16(rise, vrshrq_n_u16(vmulq_u16(t, bend), 3));
  return vaddq_u16(start, vrshrq_n_u16(vmulq_u16(t, slope), 3));
}

/// Writes the light of sixteen codes; `points` is LightCurve.
void write_light(const uint8_t* points, uint8x16_t codes, uint16_t* light) {
  const uint8x16_t n = vshrq_n_u8(codes, 4), t = vandq_u8(codes, vdupq_n_u8(15));
  const auto part = [&](int k) { return vqtbl1q_u8(vld1q_u8(points + 16 * k), n); };
  const uint8x16_t start_low = part(0), start_high = part(1), rise_low = part(2),
                   rise_high = part(3), bend = part(4);
  vst1q_u16(light, along_curve(vmovl_u8(vget_low_u8(t)),
                               vreinterpretq_u16_u8(vzip1q_u8(start_low, start_high)),
                               vreinterpretq_u16_u8(vzip1q_u8(rise_low, rise_high)),
                               vmovl_u8(vget_low_u8(bend))));
  vst1q_u16(light + 8,
            along_curve(vmovl_high_u8(t), vreinterpretq_u16_u8(vzip2q_u8(start_low, start_high)),
                        vreinterpretq_u16_u8(vzip2q_u8(rise_low, rise_high)), vmovl_high_u8(bend)));
}

/// Fills kPart places of a tile from `bytes` bytes of each view: no more are read.
void turn_part(const uint8_t* points, const uint8_t* const* views, size_t at, size_t bytes,
               uint16_t (*light)[kLaneStep]) {
  uint8x16_t rows[kLaneStep];
  for (size_t view = 0; view < kLaneStep; ++view) {
    if (bytes >= kPart) {
      rows[view] = vld1q_u8(views[view] + at);
    } else {
      uint8_t codes[kPart] = {};
      __builtin_memcpy(codes, views[view] + at, bytes);
      rows[view] = vld1q_u8(codes);
    }
  }
  transpose_16(rows);
  for (size_t n = 0; n < kPart; ++n) write_light(points, rows[n], light[n]);
}

/// Stores one entry of sixteen views from the light of two columns.
void store_entries(const uint16_t* here, const uint16_t* next, uint16_t* entries) {
  for (size_t n = 0; n < kLaneStep; n += 8) {
    const uint16x8x2_t pairs = {{vld1q_u16(here + n), vld1q_u16(next + n)}};
    vst2q_u16(entries + 2 * n, pairs);
  }
}

/// Transposes a tile of sixteen views' rows, which begin at `begin` and have `bytes`. As in
/// avx2_kernel.cpp, the next tile begins with the last three places of this tile.
void turn_views(const uint8_t* points, const uint8_t* const* views, size_t begin, size_t at,
                size_t bytes, size_t lanes, uint16_t* light) {
  const size_t count = bytes - at < kTile ? bytes - at : kTile, entry = 2 * lanes;
  Tile tile;
  for (size_t n = 0; n < count; n += kPart)
    turn_part(points, views, begin + at + n, count - n, tile.light + n);
  for (size_t n = 0; n + 3 < count; ++n)
    store_entries(tile.light[n], tile.light[n + 3], light + (at + n) * entry);
  if (at + count < bytes) return;
  for (size_t n = count - 3; n < count; ++n)
    store_entries(tile.light[n], tile.light[n], light + (at + n) * entry);
}

}  // namespace

void turn_light_neon(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                     uint16_t* light) noexcept {
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t bytes = 3 * static_cast<size_t>(pictures.width);
  for (size_t at = 0; at + 3 < bytes || at == 0; at += kTile - 3)
    for (size_t view = 0; view < lanes; view += kLaneStep)
      turn_views(terms.light_curve, pictures.first + view, begin, at, bytes, lanes,
                 light + 2 * view);
}

void mix_set_neon(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad* quads,
                  const Target& target) noexcept {
  const RunTerms run(terms, rows, set, target);
  for (uint32_t q = set.quads_begin; q < set.quads_end; ++q) {
    __builtin_prefetch(quads + q + kQuadsAhead);
    mix_quad(run, terms, set.stride, quads[q]);
  }
}

}  // namespace lenticule::frames::weave_kernel
