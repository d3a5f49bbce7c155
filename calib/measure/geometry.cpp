// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace lenticule::calib {
namespace {

/// The widest period exceeds the axis by this factor, so that noise at one end cannot be mistaken
/// for the other end.
constexpr double kMargin = 1.15;
constexpr double kFinestPart = 1.0 / 64.0;
constexpr double kFewestLenses = 6.0;
constexpr double kFinestPixels = 24.0;

/// Returns turns in [0, 1).
double turns_of(Complex wave) {
  const double turns =
      std::atan2(double{wave.imag()}, double{wave.real()}) / (2.0 * std::numbers::pi);
  return turns < 0.0 ? turns + 1.0 : turns;
}

}  // namespace

std::array<WaveLevel, 3> wave_levels(int axis_px, double lens_pitch_px) {
  const double widest = kMargin * axis_px;
  const double finest =
      std::min(widest / 9.0,
               std::max({axis_px * kFinestPart, kFewestLenses * lens_pitch_px, kFinestPixels}));
  return {{{.period_px = widest, .steps = 4},
           {.period_px = std::sqrt(widest * finest), .steps = 4},
           {.period_px = finest, .steps = 8}}};
}

std::vector<float> decode_positions(const std::array<WaveLevel, 3>& levels,
                                    const std::array<PhaseSum, 3>& sums, float least) {
  const size_t count = sums[0].waves().size();
  std::vector<float> positions(count, std::numeric_limits<float>::quiet_NaN());
  for (size_t n = 0; n < count; ++n) {
    if (std::abs(sums[2].waves()[n]) < least) continue;
    double turns = turns_of(sums[0].waves()[n]);
    // The position is slightly before the first pixel, not far beyond the last.
    if (turns > 0.5 * (1.0 + 1.0 / kMargin)) turns -= 1.0;
    double position = turns * levels[0].period_px;
    for (size_t level = 1; level < levels.size(); ++level) {
      const double period = levels[level].period_px;
      const double part = turns_of(sums[level].waves()[n]);
      position = (std::round(position / period - part) + part) * period;
    }
    positions[n] = static_cast<float>(position);
  }
  return positions;
}

}  // namespace lenticule::calib
