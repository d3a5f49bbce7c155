// SPDX-License-Identifier: Apache-2.0
// Phase stepping: the same sinusoid shown at K phases gives, at each camera pixel, the phase and
// the strength of the wave, independent of the background. K equal steps reject the harmonics 2 to
// K - 2 that a camera's curve adds.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

#include "calib/measure/grey.h"

namespace lenticule::calib {

using Complex = std::complex<float>;

/// PhaseSum sums light A + B cos(theta - 2 pi phase) of the K phases to B e^(i theta) and A.
class PhaseSum {
 public:
  PhaseSum(size_t pixels, int steps);

  /// Adds one picture's light at each pixel; the picture was shown at `phase` (turns).
  void add(const GreyPicture& picture, std::span<const uint32_t> pixels, double phase);

  /// Returns B e^(i theta) of each pixel.
  [[nodiscard]] const std::vector<Complex>& waves() const { return waves_; }
  /// Returns A of each pixel.
  [[nodiscard]] const std::vector<float>& means() const { return means_; }

 private:
  int steps_;
  std::vector<Complex> waves_;
  std::vector<float> means_;
};

}  // namespace lenticule::calib
