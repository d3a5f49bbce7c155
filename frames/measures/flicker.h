// SPDX-License-Identifier: Apache-2.0
// Flicker: how much the error of a run of pictures changes from one to the next. A steady error is
// seen as part of the picture, one that comes and goes is seen as itself.
#pragma once

#include <cstdint>
#include <vector>

#include "frames/frame.h"

namespace lenticule::frames {

struct Flicker {
  double mean = 0.0;  ///< of |e(t) - e(t - 1)| over all samples, e = test - reference, code values
  int largest = 0;
};

/// Of one place: feed it the pictures in order. Two bytes a sample.
class FlickerMeter {
 public:
  /// Against the pictures of the call before; zeros for the first. Throws Error(Input) if the sizes
  /// differ, also from those before.
  Flicker add(const FrameView& reference, const FrameView& test);

 private:
  FrameGeometry geometry_;
  std::vector<int16_t> before_;
};

}  // namespace lenticule::frames
