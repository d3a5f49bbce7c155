// SPDX-License-Identifier: Apache-2.0
// Bundles of primary rays.
#pragma once

#include "base/interval.h"

namespace lenticule::render {

[[nodiscard]] Interval operator*(Interval a, Interval b);

/// All rays (x + tan_x z, y + tan_y z, z), z < start_mm, of these numbers, in the panel frame.
struct Beam {
  Interval x_mm, tan_x;
  Interval y_mm, tan_y;
  double start_mm = 0.0;

  void extend(const Beam& other);
};

}  // namespace lenticule::render
