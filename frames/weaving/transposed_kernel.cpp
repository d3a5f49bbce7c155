// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic one subpixel after the other, from transposed picture rows in linear
// light: all inputs of a subpixel lie side by side. For every machine and every rig.
#include <algorithm>

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

int mix(int a, int b, int weight) {
  return a + (((b - a) * weight + (1 << (kWeightBits - 1))) >> kWeightBits);
}

/// Look holds the inputs of a run and its row weight.
struct Look {
  const uint16_t *upper, *lower;  ///< entries at the run's column
  int row_weight;
};

/// Mixes a view's four pixels; `at` is the view's entry.
int view_light(const Look& look, size_t at, int column_weight) {
  const uint16_t *const upper = look.upper + at, *const lower = look.lower + at;
  return mix(mix(upper[0], lower[0], look.row_weight), mix(upper[1], lower[1], look.row_weight),
             column_weight);
}

int two_views_light(const Terms& terms, const Look& look, size_t colour, int32_t number,
                    int column_weight) {
  const int32_t view = std::clamp(number, 0, terms.view_most);
  const int weight = (view >> (kViewBits - kWeightBits)) & terms.weight_mask;
  const size_t at = colour + 2 * static_cast<size_t>(view >> kViewBits);
  return mix(view_light(look, at, column_weight), view_light(look, at + 2, column_weight), weight);
}

/// Does the same as spot_light() in plain_kernel.cpp.
int spot_light(const Terms& terms, const Look& look, size_t colour, int32_t number,
               int column_weight) {
  const Spot& spot = terms.spot;
  const int part = (number & ((1 << kViewBits) - 1)) >> (kViewBits - spot.bits);
  const uint16_t* const weights = spot.weights + static_cast<ptrdiff_t>(part) * spot.taps;
  const int first = (number >> kViewBits) - spot.reach;
  const int begin = std::max(0, -first), end = std::min(spot.taps, spot.views - first);
  int64_t light = 0, sum = 0;
  for (int n = begin; n < end; ++n) {
    const size_t at = colour + 2 * static_cast<size_t>(first + n);
    light += int64_t{weights[n]} * view_light(look, at, column_weight);
    sum += weights[n];
  }
  return sum > 0 ? static_cast<int>((light + sum / 2) / sum) : 0;
}

/// Mixes one row of a record.
void mix_run(const Terms& terms, const TransposedRows& rows, const Set& set, const Quad& quad,
             int r, uint16_t* light) {
  const int step = terms.view_step + quad.view_step;
  const int count = (quad.counts >> (4 * r)) & 15;
  const size_t colour_words = 2 * rows.lanes;
  const size_t pixel = static_cast<size_t>(quad.column[r]) * 3 * colour_words;
  const Look look{static_cast<const uint16_t*>(rows.upper[r]) + pixel,
                  static_cast<const uint16_t*>(rows.lower[r]) + pixel, set.row_share[r]};
  for (int n = 0; n < count; ++n) {
    const size_t place = set.first + (size_t{quad.at[r]} + static_cast<size_t>(n)) * set.stride;
    const size_t colour = (terms.blue_first ? 2 - place % 3 : place % 3) * colour_words;
    const int bend = (n * (quad.column_step[r] + n * quad.column_bend)) >> kSlopeBits;
    const int32_t number = quad.view[r] + n * step;
    const int mixed = terms.spot.weights == nullptr
                          ? two_views_light(terms, look, colour, number, quad.share[r] + bend)
                          : spot_light(terms, look, colour, number, quad.share[r] + bend);
    light[place] = static_cast<uint16_t>(mixed);
  }
}

}  // namespace

void turn_light_plainly(const Terms& terms, const Pictures& pictures, int row, size_t lanes,
                        uint16_t* light) noexcept {
  const size_t begin = static_cast<size_t>(row) * pictures.stride;
  const size_t bytes = 3 * static_cast<size_t>(pictures.width);
  for (size_t view = 0; view < lanes; ++view) {
    const uint8_t* const codes = pictures.first[view] + begin;
    uint16_t* const entries = light + 2 * view;
    for (size_t n = 0; n < bytes; ++n) {
      entries[2 * n * lanes] = terms.light[codes[n]];
      entries[2 * n * lanes + 1] = terms.light[codes[n + 3 < bytes ? n + 3 : n]];
    }
  }
}

void mix_set_transposed(const Terms& terms, const TransposedRows& rows, const Set& set,
                        const Quad* quads, const Target& target) noexcept {
  for (uint32_t q = set.quads_begin; q < set.quads_end; ++q)
    for (int r = 0; r < kRows; ++r)
      mix_run(terms, rows, set, quads[q], r, target.light + static_cast<size_t>(r) * target.stride);
}

}  // namespace lenticule::frames::weave_kernel
