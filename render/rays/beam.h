// SPDX-License-Identifier: Apache-2.0
// Beam bounds a bundle of primary rays.
#pragma once

#include "base/interval.h"

namespace lenticule::render {

[[nodiscard]] Interval operator*(Interval a, Interval b);

/// All rays (x + tan_x z, y + tan_y z, z), z < start_mm, with parameters in these intervals, in the
/// panel frame.
struct Beam {
  Interval x_mm, tan_x;
  Interval y_mm, tan_y;
  double start_mm = 0.0;

  void extend(const Beam& other);
};

}  // namespace lenticule::render
