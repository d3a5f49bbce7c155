// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/band_order.h"

#include "base/error.h"

namespace lenticule::render {
namespace {

/// Distance of the bands of the step after the first.
constexpr int kSecond = 8;
/// Returns the distance of the first bands: few, but two if possible.
int first_stride(int bands) {
  return bands >= 8 * kSecond ? 4 * kSecond : 2 * kSecond;
}

}  // namespace

BandOrder::BandOrder(int bands)
    : gains_(static_cast<size_t>(bands)), decided_(gains_.size()), stride_(first_stride(bands)) {}

std::vector<int> BandOrder::next() {
  std::vector<int> due;
  const Sum all = sum();
  while (due.empty() && stride_ > 0) {
    const int first = is_first_ ? stride_ / 2 : 0;
    for (int band = first; band < static_cast<int>(gains_.size()); band += stride_) {
      uint8_t& decided = decided_[static_cast<size_t>(band)];
      if (decided == 0 && expected_gain(band, all) >= 0) due.push_back(band);
      decided = 1;
    }
    if (is_first_)
      stride_ = kSecond;
    else
      stride_ = all.gained == all.tried && stride_ > 1 ? 1 : stride_ / 2;
    is_first_ = false;
  }
  return due;
}

void BandOrder::note(int band, int64_t gain) {
  LENTICULE_CHECK(decided_[static_cast<size_t>(band)] != 0);
  gains_[static_cast<size_t>(band)] = gain;
}

BandOrder::Sum BandOrder::sum() const {
  Sum all;
  for (const std::optional<int64_t>& gain : gains_) {
    if (!gain) continue;
    all.total += *gain;
    ++all.tried;
    all.gained += *gain >= 0 ? 1 : 0;
  }
  return all;
}

bool BandOrder::loses() const {
  const Sum all = sum();
  return all.tried >= (all.gained == 0 ? 2 : 4) && all.total < 0;
}

/// Estimates four times the gain of a band: those of its neighbours, and twice the mean, which does
/// not make up for two neighbours that lose.
int64_t BandOrder::expected_gain(int band, const Sum& all) const {
  if (all.tried == 0) return 0;
  const int64_t mean = all.total / all.tried;
  const auto nearest = [&](int way) {
    for (int n = band; n >= 0 && n < static_cast<int>(gains_.size()); n += way)
      if (gains_[static_cast<size_t>(n)]) return *gains_[static_cast<size_t>(n)];
    return mean;
  };
  const int64_t above = nearest(-1), below = nearest(1);
  if (above < 0 && below < 0) return above + below;
  return above + below + 2 * mean;
}

}  // namespace lenticule::render
