// SPDX-License-Identifier: Apache-2.0
// Which panel point each camera pixel sees, decoded from wide sinusoids along both axes.
#pragma once

#include <array>
#include <vector>

#include "calib/measure/pattern.h"
#include "calib/measure/phase_sum.h"

namespace lenticule::calib {

/// One sinusoid of a panel axis: its period and at how many phases it is shown.
struct WaveLevel {
  double period_px = 0.0;
  int steps = 0;
};

/// From one period for the whole axis down to a fine one, each fine enough to be told apart by the
/// one before and all much wider than a lens.
[[nodiscard]] std::array<WaveLevel, 3> wave_levels(int axis_px, double lens_pitch_px);

/// Positions along one axis, in pixels, from the waves of its three levels; NaN where the last
/// level is weaker than `least` (same unit as the waves).
[[nodiscard]] std::vector<float> decode_positions(const std::array<WaveLevel, 3>& levels,
                                                  const std::array<PhaseSum, 3>& sums, float least);

}  // namespace lenticule::calib
