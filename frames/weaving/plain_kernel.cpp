// SPDX-License-Identifier: Apache-2.0
// The fast weaver's arithmetic one subpixel after the other, for every machine and every rig.
#include <algorithm>

#include "frames/weaving/weave_kernel.h"

namespace lenticule::frames::weave_kernel {
namespace {

int mix(int a, int b, int weight) {
  return a + (((b - a) * weight + (1 << (kWeightBits - 1))) >> kWeightBits);
}

/// How far the column has moved along a run.
int bent(const Quad& quad, int r, int n) {
  return (n * (quad.column_step[r] + n * quad.column_bend)) >> kSlopeBits;
}

/// Where one subpixel looks.
struct Look {
  int view, view_weight;
  int column, column_weight;
  int channel;
};

/// The light of one picture row's two pixels, each mixed from two views.
class Taps {
 public:
  Taps(const Terms& terms, const Pictures& pictures, const Look& look)
      : terms_(terms), stride_(pictures.stride), look_(look) {
    const int next_view = std::min(look.view + 1, pictures.views - 1);
    left_ = 3 * look.column + look.channel;
    right_ = 3 * std::min(look.column + 1, pictures.width - 1) + look.channel;
    a_ = pictures.first[look.view];
    b_ = pictures.first[next_view];
  }
  [[nodiscard]] int left(int row) const { return tap(row, left_); }
  [[nodiscard]] int right(int row) const { return tap(row, right_); }

 private:
  [[nodiscard]] int tap(int row, int offset) const {
    const size_t at = static_cast<size_t>(row) * stride_ + static_cast<size_t>(offset);
    return mix(terms_.light[a_[at]], terms_.light[b_[at]], look_.view_weight);
  }
  const Terms& terms_;
  size_t stride_;
  Look look_;
  int left_, right_;
  const uint8_t *a_, *b_;
};

/// Light of a view's four pixels, mixed.
int picture_light(const Terms& terms, const Pictures& pictures, const Look& look, int upper,
                  int row_weight) {
  const int lower = std::min(upper + 1, pictures.height - 1);
  const Taps taps(terms, pictures, look);
  const int left = mix(taps.left(upper), taps.left(lower), row_weight);
  const int right = mix(taps.right(upper), taps.right(lower), row_weight);
  return mix(left, right, look.column_weight);
}

/// Many views under the lens's spot. The view number is not clamped: views at the ends weigh less
/// the further off they are.
int spot_light(const Terms& terms, const Pictures& pictures, Look look, int32_t view, int upper,
               int row_weight) {
  const Spot& spot = terms.spot;
  const int part = (view & ((1 << kViewBits) - 1)) >> (kViewBits - spot.bits);
  const uint16_t* const weights = spot.weights + static_cast<ptrdiff_t>(part) * spot.taps;
  const int first = (view >> kViewBits) - spot.reach;
  int64_t light = 0, sum = 0;
  look.view_weight = 0;
  for (int n = std::max(0, -first); n < spot.taps && first + n < pictures.views; ++n) {
    look.view = first + n;
    light += int64_t{weights[n]} * picture_light(terms, pictures, look, upper, row_weight);
    sum += weights[n];
  }
  return sum > 0 ? static_cast<int>((light + sum / 2) / sum) : 0;
}

/// One row of a quad.
void mix_run(const Terms& terms, const Pictures& pictures, const Set& set, const Quad& quad, int r,
             uint16_t* light) {
  const int step = terms.view_step + quad.view_step;
  const int count = (quad.counts >> (4 * r)) & 15;
  const int upper = set.row[r], row_weight = set.row_share[r];
  for (int n = 0; n < count; ++n) {
    const int32_t number = quad.view[r] + n * step;
    const int view = std::clamp(number, 0, terms.view_most);
    const size_t place = set.first + (size_t{quad.at[r]} + static_cast<size_t>(n)) * set.stride;
    const int colour = static_cast<int>(place % 3);
    const Look look{.view = view >> kViewBits,
                    .view_weight = (view >> (kViewBits - kWeightBits)) & terms.weight_mask,
                    .column = quad.column[r],
                    .column_weight = quad.share[r] + bent(quad, r, n),
                    .channel = terms.blue_first ? 2 - colour : colour};
    const int mixed = terms.spot.weights == nullptr
                          ? picture_light(terms, pictures, look, upper, row_weight)
                          : spot_light(terms, pictures, look, number, upper, row_weight);
    light[place] = static_cast<uint16_t>(mixed);
  }
}

}  // namespace

void mix_set_plainly(const Terms& terms, const Pictures& pictures, const Set& set,
                     const Quad* quads, const Target& target) noexcept {
  for (uint32_t q = set.quads_begin; q < set.quads_end; ++q)
    for (int r = 0; r < kRows; ++r)
      mix_run(terms, pictures, set, quads[q], r,
              target.light + static_cast<size_t>(r) * target.light_stride);
}

void encode_plainly(const Terms& terms, const uint16_t* light, size_t count,
                    uint8_t* codes) noexcept {
  for (size_t n = 0; n < count; ++n) codes[n] = terms.codes[light[n]];
}

}  // namespace lenticule::frames::weave_kernel
