// SPDX-License-Identifier: Apache-2.0
// The workshop in which tests calibrate from hand-held photographs: a panel whose photographs are
// simulated in about three seconds.
#pragma once

#include "apps/lenticule-bench/phone/workshop.h"

namespace lenticule::test {

inline phone_bench::WorkshopLimits small_workshop(int shots) {
  phone_bench::WorkshopLimits limits;
  limits.panel_width = 1920;
  limits.diagonal_inches = 24.0;
  limits.phone_width = 3200;
  limits.least_pitch_subpx = 4.0;
  limits.most_pitch_subpx = 5.0;
  limits.shots = shots;
  return limits;
}

}  // namespace lenticule::test
