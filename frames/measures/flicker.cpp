// SPDX-License-Identifier: Apache-2.0
#include "frames/measures/flicker.h"

#include <algorithm>
#include <cstdlib>

#include "frames/compare.h"

namespace lenticule::frames {

Flicker FlickerMeter::add(const FrameView& reference, const FrameView& test) {
  require_same_size(reference, test);
  const bool first = before_.empty();
  if (!first) require_same_size({geometry_, {}}, test);
  geometry_ = test.geometry;
  before_.resize(test.bytes.size());
  uint64_t sum = 0;
  int largest = 0;
  for (size_t s = 0; s < before_.size(); ++s) {
    const int error = int{test.bytes[s]} - int{reference.bytes[s]};
    const int change = first ? 0 : std::abs(error - before_[s]);
    sum += static_cast<uint64_t>(change);
    largest = std::max(largest, change);
    before_[s] = static_cast<int16_t>(error);
  }
  const double samples = std::max(1.0, static_cast<double>(before_.size()));
  return {.mean = static_cast<double>(sum) / samples, .largest = largest};
}

}  // namespace lenticule::frames
