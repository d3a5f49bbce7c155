// SPDX-License-Identifier: Apache-2.0
#include "calib/measure/phase_sum.h"

#include <cmath>
#include <numbers>

namespace lenticule::calib {

PhaseSum::PhaseSum(size_t pixels, int steps) : steps_(steps), waves_(pixels), means_(pixels) {}

void PhaseSum::add(const GreyPicture& picture, std::span<const uint32_t> pixels, double phase) {
  const double angle = 2.0 * std::numbers::pi * phase;
  const double share = 2.0 / steps_;
  const auto cosine = static_cast<float>(share * std::cos(angle));
  const auto sine = static_cast<float>(share * std::sin(angle));
  const auto mean = static_cast<float>(1.0 / steps_);
  for (size_t n = 0; n < pixels.size(); ++n) {
    const float light = picture.light[pixels[n]];
    waves_[n] += Complex(light * cosine, light * sine);
    means_[n] += light * mean;
  }
}

}  // namespace lenticule::calib
