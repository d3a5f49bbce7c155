// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/audit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace lenticule::render {
namespace {

TEST(Audit, BoundsAShareByTheBinomialDistribution) {
  EXPECT_EQ(bound_of_share({}), 1.0);
  EXPECT_EQ(bound_of_share({.sampled = 5, .beyond = 5}), 1.0);
  // None of n exceeds the tolerance: (1 - p)^n = 0.0001.
  EXPECT_NEAR(bound_of_share({.sampled = 459, .beyond = 0}), 1.0 - std::pow(0.0001, 1.0 / 459.0),
              1e-9);
  // One of two: 1 - p^2 = 0.0001.
  EXPECT_NEAR(bound_of_share({.sampled = 2, .beyond = 1}), std::sqrt(0.9999), 1e-9);
  // Many samples: the normal approximation.
  const double normal = 0.02 + 3.719 * std::sqrt(0.02 * 0.98 / 50000.0);
  EXPECT_NEAR(bound_of_share({.sampled = 50000, .beyond = 1000}), normal, 2e-4);
}

/// With the stated probability, two of 1800 bounds are too low once in 70 times.
TEST(Audit, TheBoundHoldsInTheFramesOfASequence) {
  std::mt19937_64 random(3);
  int too_low = 0;
  for (const double share : {0.001, 0.02, 0.3}) {
    std::binomial_distribution<uint64_t> beyond(700, share);
    for (int n = 0; n < 600; ++n)
      too_low += bound_of_share({.sampled = 700, .beyond = beyond(random)}) < share ? 1 : 0;
  }
  EXPECT_LE(too_low, 1);
}

/// 2.39 % of a frame at 1080p were beyond, and its bound was 2.36 % with 99 % confidence, which is
/// that of 249 among 12187.
TEST(Audit, TheBoundHoldsForAnUnluckySelection) {
  EXPECT_GE(bound_of_share({.sampled = 12187, .beyond = 249}), 0.0239);
}

TEST(Audit, RetracesBadBandsAndToleratesChance) {
  EXPECT_FALSE(needs_retracing({.sampled = 360, .beyond = 0}, 0.03));
  EXPECT_FALSE(needs_retracing({.sampled = 360, .beyond = 15}, 0.03));
  EXPECT_TRUE(needs_retracing({.sampled = 360, .beyond = 40}, 0.03));
  EXPECT_FALSE(needs_retracing({}, 0.03));
}

TEST(Audit, SamplesUniformly) {
  constexpr uint32_t kRows = 64, kColumns = 11520;
  uint64_t retracing = 0, evaluation = 0, odd_rows = 0;
  std::array<uint64_t, 3> channels{};
  std::array<uint64_t, 4> quarters{};
  for (uint32_t row = 0; row < kRows; ++row)
    for (uint32_t stretch = 0; stretch * kSampledOneIn < kColumns; ++stretch) {
      const SampledPair sampled = sampled_pair(row, stretch);
      ASSERT_NE(sampled.retracing, sampled.evaluation);
      for (const uint32_t at : {sampled.retracing, sampled.evaluation}) {
        ASSERT_EQ(at / kSampledOneIn, stretch);
        if (at >= kColumns) continue;
        ++(at == sampled.retracing ? retracing : evaluation);
        odd_rows += row % 2;
        ++channels[at % 3];
        ++quarters[at % kSampledOneIn / (kSampledOneIn / 4)];
      }
    }
  const double expected = double{kRows} * kColumns / kSampledOneIn;
  const double deviation = 5.0 * std::sqrt(expected);
  EXPECT_NEAR(static_cast<double>(retracing), expected, deviation);
  EXPECT_NEAR(static_cast<double>(evaluation), expected, deviation);
  EXPECT_NEAR(static_cast<double>(odd_rows), expected, deviation);
  for (const uint64_t sampled : channels)
    EXPECT_NEAR(static_cast<double>(sampled), 2.0 * expected / 3.0, deviation);
  for (const uint64_t sampled : quarters)
    EXPECT_NEAR(static_cast<double>(sampled), 2.0 * expected / 4.0, deviation);
}

}  // namespace
}  // namespace lenticule::render
