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
  while (due.empty() && stride_ > 0) {
    const int first = is_first_ ? stride_ / 2 : 0;
    for (int band = first; band < static_cast<int>(gains_.size()); band += stride_) {
      uint8_t& decided = decided_[static_cast<size_t>(band)];
      if (decided == 0 && expected_gain(band) >= 0) due.push_back(band);
      decided = 1;
    }
    if (is_first_)
      stride_ = kSecond;
    else
      stride_ = all_gained_ && stride_ > 1 ? 1 : stride_ / 2;
    is_first_ = false;
  }
  return due;
}

void BandOrder::note(int band, int64_t gain) {
  LENTICULE_CHECK(decided_[static_cast<size_t>(band)] != 0);
  gains_[static_cast<size_t>(band)] = gain;
  all_gained_ = all_gained_ && gain >= 0;
  none_gained_ = none_gained_ && gain < 0;
  total_ += gain;
  ++tried_;
}

/// Estimates four times the gain of a band: those of its neighbours, and twice the mean, which does
/// not make up for two neighbours that lose.
int64_t BandOrder::expected_gain(int band) const {
  if (tried_ == 0) return 0;
  const int64_t mean = total_ / tried_;
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
