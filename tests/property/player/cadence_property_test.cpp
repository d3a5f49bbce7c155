// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "player/playback/pacing.h"

namespace lenticule::player {
namespace {

using frames::Rate;
__extension__ typedef unsigned __int128 Uint128;

/// Returns floor(k * refresh / content) in exact arithmetic.
uint64_t ideal_vblank(uint64_t k, Rate content, Rate refresh) {
  const Uint128 numerator = Uint128{k} * static_cast<uint64_t>(refresh.numerator) *
                            static_cast<uint64_t>(content.denominator);
  return static_cast<uint64_t>(numerator / (Uint128{static_cast<uint64_t>(refresh.denominator)} *
                                            static_cast<uint64_t>(content.numerator)));
}

void expect_exact(Rate content, Rate refresh, uint64_t frames) {
  Cadence cadence(content, refresh);
  for (uint64_t k = 0; k < frames; ++k) {
    ASSERT_EQ(cadence.frame(), k);
    ASSERT_EQ(cadence.due(), ideal_vblank(k, content, refresh))
        << frames::to_string(content) << " on " << frames::to_string(refresh) << ", frame " << k;
    const uint64_t next = cadence.next_due();
    cadence.advance();
    ASSERT_EQ(cadence.due(), next);
  }
}

TEST(CadenceProperty, IsExactOverAMillionFrames) {
  for (const Rate content : {Rate{24, 1}, Rate{25, 1}, Rate{24000, 1001}, Rate{60, 1}})
    for (const Rate refresh : {Rate{60, 1}, Rate{60000, 1001}, Rate{533250000, 8899200}})
      expect_exact(content, refresh, 1'000'000);
}

TEST(CadenceProperty, IsExactForRandomRates) {
  std::mt19937_64 random(20240607);
  std::uniform_int_distribution<int64_t> numerator(1, 1'000'000);
  std::uniform_int_distribution<int64_t> denominator(1, 20'000);
  for (int round = 0; round < 2000; ++round)
    expect_exact({numerator(random), denominator(random)}, {numerator(random), denominator(random)},
                 200);
}

TEST(CadenceProperty, LockingChangesTheSpeedByAtMostHalfAPercent) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int64_t> numerator(1, 240'000);
  std::uniform_int_distribution<int64_t> denominator(1, 2'000);
  for (int round = 0; round < 20000; ++round) {
    const Rate content{numerator(random), denominator(random)};
    const Rate refresh{numerator(random), denominator(random)};
    const double ratio = locked_rate(content, refresh).hertz() / content.hertz();
    ASSERT_NEAR(ratio, 1.0, 0.00503)
        << frames::to_string(content) << " on " << frames::to_string(refresh);
  }
}

}  // namespace
}  // namespace lenticule::player
