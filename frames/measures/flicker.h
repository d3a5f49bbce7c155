// SPDX-License-Identifier: Apache-2.0
// FlickerMeter measures flicker: the change of the error from one picture to the next. A steady
// error looks like part of the picture; a changing error is noticed.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

struct Flicker {
  double mean =
      0.0;  ///< mean of |e(t) - e(t - 1)| over all samples, e = test - reference, code values
  int largest = 0;
};

/// FlickerMeter measures one sequence, whose pictures it receives in order. Uses two bytes per
/// sample.
class FlickerMeter {
 public:
  /// Returns the change since the previous call; zeros for the first call. Throws Error(Input) if
  /// the sizes differ, also from the previous sizes.
  Flicker add(const FrameView& reference, const FrameView& test);

 private:
  FrameGeometry geometry_;
  std::vector<int16_t> before_;
};

}  // namespace lenticule::frames
