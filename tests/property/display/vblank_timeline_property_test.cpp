// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "display/clock.h"

namespace lenticule::display {
namespace {

constexpr uint64_t kSeed = 20240607;
constexpr int64_t kNanosecondsPer400Days = int64_t{400} * 24 * 3600 * 1'000'000'000;

frames::Rate random_rate(std::mt19937_64& random) {
  std::uniform_int_distribution<int64_t> denominator(1, 100'000'000);
  std::uniform_int_distribution<int64_t> hertz(1, 10000);
  const int64_t d = denominator(random);
  std::uniform_int_distribution<int64_t> wobble(0, d - 1);
  const int64_t n = std::min(hertz(random) * d + wobble(random), VblankTimeline::kMaxTerm);
  return {n, d};
}

TEST(VblankTimelineProperty, SequenceAndTimeAreInversesFor400Days) {
  std::mt19937_64 random(kSeed);
  for (int round = 0; round < 20000; ++round) {
    const frames::Rate rate = random_rate(random);
    const VblankTimeline timeline(Nanoseconds(round), rate);
    const int64_t now = std::uniform_int_distribution<int64_t>(1, kNanosecondsPer400Days)(random);
    const uint64_t n = timeline.sequence_at(Nanoseconds(now + round));
    ASSERT_LE(timeline.time_of(n), Nanoseconds(now + round)) << frames::to_string(rate);
    ASSERT_GT(timeline.time_of(n + 1), Nanoseconds(now + round)) << frames::to_string(rate);
    ASSERT_EQ(timeline.sequence_at(timeline.time_of(n)), n);
    ASSERT_EQ(timeline.sequence_at(timeline.time_of(n + 1) - Nanoseconds(1)), n);
  }
}

TEST(VblankTimelineProperty, PeriodsDifferByAtMostANanosecond) {
  std::mt19937_64 random(kSeed);
  for (int round = 0; round < 200; ++round) {
    const VblankTimeline timeline(Nanoseconds(0), random_rate(random));
    for (uint64_t n = 0; n < 200; ++n) {
      const Nanoseconds gap = timeline.time_of(n + 1) - timeline.time_of(n);
      ASSERT_GE(gap, timeline.period());
      ASSERT_LE(gap, timeline.period() + Nanoseconds(1));
    }
  }
}

}  // namespace
}  // namespace lenticule::display
