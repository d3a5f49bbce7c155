// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>

#include "calib/measure/fringe_phase.h"
#include "calib/measure/pattern.h"

namespace lenticule::calib {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

/// Returns the wave at a pixel that sees `light` of cos(theta - 2 pi phase).
Complex stepped(double theta, int steps, const std::function<double(double)>& light) {
  PhaseSum sum(1, steps);
  const std::vector<uint32_t> pixel = {0};
  for (const double phase : phase_steps(steps)) {
    GreyPicture picture{.width = 1, .height = 1, .light = {}, .clipped = {0}};
    picture.light.push_back(static_cast<float>(light(std::cos(theta - kTurn * phase))));
    sum.add(picture, pixel, phase);
  }
  return sum.waves()[0];
}

double angle_between(Complex wave, double theta) {
  return std::remainder(std::arg(wave) - theta, kTurn);
}

TEST(PhaseSum, ASinusoidGivesItsPhaseAndAmplitudeOnAnyBackground) {
  for (const int steps : {3, 4, 8})
    for (double theta = 0.0; theta < kTurn; theta += 0.31) {
      const Complex wave = stepped(theta, steps, [](double c) { return 0.4 + 0.25 * c; });
      EXPECT_NEAR(angle_between(wave, theta), 0.0, 1e-6);
      EXPECT_NEAR(std::abs(wave), 0.25, 1e-6);
    }
}

TEST(PhaseSum, EightStepsCancelACamerasTransferFunction) {
  double worst3 = 0.0, worst8 = 0.0;
  const auto curved = [](double c) { return std::pow(0.5 + 0.45 * c, 1.0 / 2.2); };
  for (double theta = 0.0; theta < kTurn; theta += 0.1) {
    worst3 = std::max(worst3, std::abs(angle_between(stepped(theta, 3, curved), theta)));
    worst8 = std::max(worst8, std::abs(angle_between(stepped(theta, 8, curved), theta)));
  }
  EXPECT_GT(worst3, 0.05);
  EXPECT_LT(worst8, 0.002 * kTurn);
}

TEST(Geometry, RecoversPositionsFromThreeLevels) {
  constexpr int kAxis = 3840;
  const auto levels = wave_levels(kAxis, 2.567);
  EXPECT_GE(levels[0].period_px, kAxis);
  EXPECT_GE(levels[2].period_px, 6 * 2.567);
  std::vector<uint32_t> pixels(kAxis);
  std::iota(pixels.begin(), pixels.end(), 0U);
  std::vector<PhaseSum> sums;
  for (const WaveLevel& level : levels) {
    sums.emplace_back(pixels.size(), level.steps);
    for (const double phase : phase_steps(level.steps)) {
      GreyPicture picture{.width = kAxis, .height = 1, .light = {}, .clipped = {}};
      for (int i = 0; i < kAxis; ++i) {
        // A fixed pattern of errors, a few percent.
        const double noise = 0.03 * std::sin(12.9898 * i + 78.233 * phase * level.period_px);
        const double turns = (i + 0.5) / level.period_px - phase;
        picture.light.push_back(
            static_cast<float>(0.3 + 0.2 * std::cos(kTurn * turns) + 0.3 * noise));
      }
      sums.back().add(picture, pixels, phase);
    }
  }
  const std::vector<float> found = decode_positions(levels, {sums[0], sums[1], sums[2]}, 0.05F);
  for (int i = 0; i < kAxis; ++i) ASSERT_NEAR(found[static_cast<size_t>(i)], i + 0.5, 0.6) << i;
}

TEST(Geometry, DarkPixelsHaveNoPosition) {
  const auto levels = wave_levels(1920, 3.0);
  const PhaseSum nothing(4, 8);
  for (const float position : decode_positions(levels, {nothing, nothing, nothing}, 0.01F))
    EXPECT_TRUE(std::isnan(position));
}

}  // namespace
}  // namespace lenticule::calib
