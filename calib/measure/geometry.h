// SPDX-License-Identifier: Apache-2.0
// Decodes the panel point that each camera pixel sees, from wide sinusoids along both axes.
#pragma once

#include <array>
#include <vector>

#include "calib/measure/pattern.h"
#include "calib/measure/phase_sum.h"

namespace lenticule::calib {

/// WaveLevel is one sinusoid of a panel axis: its period and its number of phase steps.
struct WaveLevel {
  double period_px = 0.0;
  int steps = 0;
};

/// Returns three levels, from one period for the whole axis down to a fine one. Each level is
/// coarse enough to be unwrapped by the previous one, and all are much wider than a lens.
[[nodiscard]] std::array<WaveLevel, 3> wave_levels(int axis_px, double lens_pitch_px);

/// Returns positions along one axis, in pixels, from the waves of its three levels; NaN where the
/// last level is weaker than `least` (same unit as the waves).
[[nodiscard]] std::vector<float> decode_positions(const std::array<WaveLevel, 3>& levels,
                                                  const std::array<PhaseSum, 3>& sums, float least);

}  // namespace lenticule::calib
