// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/audit.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace lenticule::render {
namespace {

TEST(Audit, BoundsAShareByTheBinomialDistribution) {
  EXPECT_EQ(bound_of_share({}), 1.0);
  EXPECT_EQ(bound_of_share({.sampled = 5, .beyond = 5}), 1.0);
  // None of n exceeds the tolerance: (1 - p)^n is the doubt, and the doubts of all looks add up.
  double doubt = 0.0;
  for (int look = 0; look < kMeanSquareLooks; ++look)
    doubt += std::pow(1.0 - bound_of_share({.sampled = 459, .beyond = 0}, look), 459.0);
  EXPECT_NEAR(doubt, 0.0001, 1e-9);
  // One of two: 1 - p^2 = 0.000095.
  EXPECT_NEAR(bound_of_share({.sampled = 2, .beyond = 1}), std::sqrt(0.999905), 1e-9);
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

/// Counts of the subpixels that a selection takes from an area.
struct Selected {
  uint64_t retracing = 0, evaluation = 0, odd_rows = 0;
  std::array<uint64_t, 3> channels{};
  std::array<uint64_t, 4>
      quarters{};  ///< counts in each quarter of a stretch from which one is taken
};

constexpr uint32_t kRows = 64, kColumns = 11520;

Selected selected(const AuditSelection& selection) {
  Selected all;
  for (uint32_t row = 0; row < kRows; ++row)
    for (uint32_t stretch = 0; stretch * selection.one_in() < kColumns; ++stretch) {
      const SampledPair sampled = selection.pair(row, stretch);
      EXPECT_NE(sampled.retracing, sampled.evaluation);
      for (const uint32_t at : {sampled.retracing, sampled.evaluation}) {
        if (at >= kColumns) continue;
        EXPECT_EQ(at / selection.one_in(), stretch);
        ++(at == sampled.retracing ? all.retracing : all.evaluation);
        all.odd_rows += row % 2;
        ++all.channels[at % 3];
        ++all.quarters[at % selection.one_in() * 4 / selection.one_in()];
      }
    }
  return all;
}

TEST(Audit, SamplesUniformly) {
  struct Density {
    uint32_t one_in, retracing_one_in;
  };
  for (const auto [one_in, retracing_one_in] :
       {Density{kSampledOneIn, kSampledOneIn}, Density{40, kSampledOneIn}, Density{100, 100}}) {
    const Selected all = selected(AuditSelection(one_in, retracing_one_in));
    const double retracing = double{kRows} * kColumns / (retracing_one_in / one_in * one_in);
    const double evaluation = double{kRows} * kColumns / one_in;
    const auto near = [](uint64_t count, double expected) {
      EXPECT_NEAR(static_cast<double>(count), expected, 5.0 * std::sqrt(expected));
    };
    near(all.retracing, retracing);
    near(all.evaluation, evaluation);
    near(all.odd_rows, (retracing + evaluation) / 2.0);
    for (const uint64_t sampled : all.channels) near(sampled, (retracing + evaluation) / 3.0);
    for (const uint64_t sampled : all.quarters) near(sampled, (retracing + evaluation) / 4.0);
  }
}

AuditErrors errors_of(const std::vector<int>& errors, uint64_t exact = 0) {
  AuditErrors all;
  all.add_exact(exact);
  for (const int error : errors) all.add(0, static_cast<uint8_t>(error));
  return all;
}

/// Two edges of a model cross a frame at a quarter and at three quarters of its height, say.
TEST(BandOrder, TwoBandsThatLoseDoNotLeaveAFrameToFull) {
  for (const int bands : {17, 34, 68, 135}) {
    BandOrder order(bands);
    const std::vector<int> first = order.next();
    ASSERT_GE(first.size(), 4U) << bands;
    EXPECT_LE(first.size(), 8U) << bands;
    for (size_t n = 0; n < first.size(); ++n) order.note(first[n], n == 0 || n == 2 ? -90 : 100);
    EXPECT_FALSE(order.loses()) << bands;
    EXPECT_FALSE(order.next().empty()) << bands;
  }
}

TEST(BandOrder, AFrameWhoseFirstBandsLoseIsLeftToFull) {
  BandOrder order(68);
  for (const int band : order.next()) order.note(band, -1);
  EXPECT_TRUE(order.loses());
}

TEST(AuditErrors, HaveMeanAndStandardErrorOfTheirSquares) {
  const AuditErrors none;
  EXPECT_EQ(none.mean_square(), 0.0);
  EXPECT_EQ(none.standard_error(), 0.0);
  const AuditErrors some = errors_of({1, 2, 3}, 1);
  EXPECT_EQ(some.sampled(), 4U);
  EXPECT_EQ(some.at_least(2), 2U);
  EXPECT_EQ(some.counts(2.0).beyond, 1U);
  EXPECT_EQ(some.counts(1.5).beyond, 2U);
  EXPECT_EQ(some.counts(300.0).beyond, 0U);
  EXPECT_DOUBLE_EQ(some.mean_square(), 3.5);
  // Squares 0, 1, 4, 9: their variance is 49 / 3.
  EXPECT_DOUBLE_EQ(some.standard_error(), std::sqrt(49.0 / 3.0 / 4.0));
}

TEST(AuditErrors, TheBoundIncludesErrorsThatNoSampleShows) {
  // None of 100000 samples is wrong, so one subpixel in 20000 may still be wrong by 255.
  const double bound = bound_of_mean_square(errors_of({}, 100000));
  EXPECT_GT(bound, 0.00004 * 255 * 255);
  EXPECT_LT(bound, 0.00006 * 255 * 255);
  EXPECT_EQ(bound_of_mean_square({}), 255.0 * 255.0);
}

/// A set that is chosen after others were refused needs a better proof: the probabilities that any
/// of the bounds is too low add up.
TEST(AuditErrors, AllLooksAtAFrameTogetherHaveTheConfidenceOfOne) {
  double doubt = 0.0;
  const double samples = 100000.0;
  for (int look = 0; look < kMeanSquareLooks; ++look) {
    // Without errors the bound is -log(0.9 doubt) * 256^2 / samples.
    const double bound = bound_of_mean_square(errors_of({}, 100000), look);
    doubt += std::exp(-bound * samples / (256.0 * 256.0)) / 0.9;
  }
  EXPECT_NEAR(doubt, 0.01, 1e-6);
}

/// A frame with few large errors, as where thin lines vanish, and one with many small errors.
TEST(AuditErrors, TheBoundHoldsAndIsNotMuchLarger) {
  std::mt19937_64 random(5);
  struct Kind {
    double share;
    int error;
  };
  for (const std::vector<Kind>& kinds :
       {std::vector<Kind>{{0.0005, 120}}, {{0.3, 1}, {0.1, 2}, {0.02, 7}}, {{0.01, 30}}}) {
    double truth = 0.0;
    for (const Kind& kind : kinds) truth += kind.share * kind.error * kind.error;
    for (int n = 0; n < 200; ++n) {
      AuditErrors errors;
      uint64_t left = 200000;
      for (const Kind& kind : kinds) {
        const uint64_t count = std::binomial_distribution<uint64_t>(200000, kind.share)(random);
        for (uint64_t i = 0; i < count; ++i) errors.add(0, static_cast<uint8_t>(kind.error));
        left -= count;
      }
      errors.add_exact(left);
      EXPECT_GE(bound_of_mean_square(errors), truth);
      EXPECT_LE(bound_of_mean_square(errors), 1.7 * truth + 2.5);
    }
  }
}

TEST(Audit, TakesAsManySamplesAsAProofNeeds) {
  for (const double mean_square : {1.0, 6.5, 20.0}) {
    const uint64_t subpixels = 3 * 1920 * 1080;
    const uint32_t one_in = sampled_one_in_for(mean_square, subpixels);
    const double bound = bound_of_mean_square(errors_of({}, subpixels / one_in));
    EXPECT_NEAR(bound, mean_square / 2.0, 0.05 * mean_square);
  }
  EXPECT_EQ(sampled_one_in_for(1e-3, 1000), 2U);
  EXPECT_EQ(sampled_one_in_for(1e3, uint64_t{1} << 32), kSampledOneIn);
}

}  // namespace
}  // namespace lenticule::render
