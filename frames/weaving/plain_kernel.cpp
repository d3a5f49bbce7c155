// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic one subpixel after the other, for every machine and every rig.
#include <algorithm>

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

int mix(int a, int b, int weight) {
  return a + (((b - a) * weight + (1 << (kWeightBits - 1))) >> kWeightBits);
}

/// Returns how far the column has moved along a run.
int bent(const Quad& quad, int r, int n) {
  return (n * (quad.column_step[r] + n * quad.column_bend)) >> kSlopeBits;
}

/// Look holds the inputs of one subpixel.
struct Look {
  int view, view_weight;
  int column, column_weight;
  int row, row_weight;
  int channel;
};

/// Mixes a view's four pixels.
int view_light(const Terms& terms, const Pictures& pictures, const Look& look, int view) {
  const int next_row = std::min(look.row + 1, pictures.height - 1);
  const int next_column = std::min(look.column + 1, pictures.width - 1);
  const uint8_t* const first = pictures.first[std::min(view, pictures.views - 1)] + look.channel;
  const uint8_t* const upper = first + static_cast<size_t>(look.row) * pictures.stride;
  const uint8_t* const lower = first + static_cast<size_t>(next_row) * pictures.stride;
  const auto column = [&](int at) {
    return mix(terms.light[upper[3 * at]], terms.light[lower[3 * at]], look.row_weight);
  };
  return mix(column(look.column), column(next_column), look.column_weight);
}

int two_views_light(const Terms& terms, const Pictures& pictures, const Look& look) {
  const int light = view_light(terms, pictures, look, look.view);
  if (look.view_weight == 0) return light;
  return mix(light, view_light(terms, pictures, look, look.view + 1), look.view_weight);
}

/// Mixes many views under the lens's spot. The view number is not clamped: views at the ends weigh
/// less the further they are.
int spot_light(const Terms& terms, const Pictures& pictures, const Look& look, int32_t number) {
  const Spot& spot = terms.spot;
  const int part = (number & ((1 << kViewBits) - 1)) >> (kViewBits - spot.bits);
  const uint16_t* const weights = spot.weights + static_cast<ptrdiff_t>(part) * spot.taps;
  const int first = (number >> kViewBits) - spot.reach;
  int64_t light = 0, sum = 0;
  for (int n = std::max(0, -first); n < spot.taps && first + n < pictures.views; ++n) {
    light += int64_t{weights[n]} * view_light(terms, pictures, look, first + n);
    sum += weights[n];
  }
  return sum > 0 ? static_cast<int>((light + sum / 2) / sum) : 0;
}

/// Mixes one row of a record.
void mix_run(const Terms& terms, const Pictures& pictures, const Set& set, const Quad& quad, int r,
             uint16_t* light) {
  const int step = terms.view_step + quad.view_step;
  const int count = (quad.counts >> (4 * r)) & 15;
  for (int n = 0; n < count; ++n) {
    const int32_t number = quad.view[r] + n * step;
    const int view = std::clamp(number, 0, terms.view_most);
    const size_t place = set.first + (size_t{quad.at[r]} + static_cast<size_t>(n)) * set.stride;
    const int colour = static_cast<int>(place % 3);
    const Look look{.view = view >> kViewBits,
                    .view_weight = (view >> (kViewBits - kWeightBits)) & terms.weight_mask,
                    .column = quad.column[r],
                    .column_weight = quad.share[r] + bent(quad, r, n),
                    .row = set.row[r],
                    .row_weight = set.row_share[r],
                    .channel = terms.blue_first ? 2 - colour : colour};
    const int mixed = terms.spot.weights == nullptr ? two_views_light(terms, pictures, look)
                                                    : spot_light(terms, pictures, look, number);
    light[place] = static_cast<uint16_t>(mixed);
  }
}

}  // namespace

void mix_set_plainly(const Terms& terms, const Pictures& pictures, const Set& set,
                     const Quad* quads, const Target& target) noexcept {
  for (uint32_t q = set.quads_begin; q < set.quads_end; ++q)
    for (int r = 0; r < kRows; ++r)
      mix_run(terms, pictures, set, quads[q], r,
              target.light + static_cast<size_t>(r) * target.stride);
}

void encode_plainly(const Terms& terms, const uint16_t* light, size_t count,
                    uint8_t* codes) noexcept {
  const uint8_t* const table = terms.codes;  // `codes` might alias the data that `terms` points to
  size_t n = 0;
  for (; n + 8 <= count; n += 8) {
    uint8_t eight[8];
    for (size_t k = 0; k < 8; ++k) eight[k] = table[light[n + k]];
    for (size_t k = 0; k < 8; ++k) codes[n + k] = eight[k];
  }
  for (; n < count; ++n) codes[n] = table[light[n]];
}

}  // namespace lenticule::frames::weave_kernel
