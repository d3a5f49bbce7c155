// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "player/playback/play_statistics.h"

namespace lenticule::player {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::nanoseconds;

TEST(LatencyHistogram, PercentilesAreAtMostOneBinTooLarge) {
  LatencyHistogram histogram;
  for (int us = 1; us <= 1000; ++us) histogram.record(microseconds(us));
  const LatencySummary summary = histogram.summary();
  EXPECT_EQ(summary.count, 1000u);
  EXPECT_GE(summary.p50_us, 500.0);
  EXPECT_LE(summary.p50_us, 500.0 * 1.07);
  EXPECT_GE(summary.p99_us, 990.0);
  EXPECT_LE(summary.p99_us, 1000.0);
  EXPECT_EQ(summary.max_us, 1000.0);
}

TEST(LatencyHistogram, OneLargeValueIsTheMaximumNotTheMedian) {
  LatencyHistogram histogram;
  for (int i = 0; i < 999; ++i) histogram.record(nanoseconds(5));
  histogram.record(hours(100));
  EXPECT_EQ(histogram.summary().p99_us, 0.005);
  EXPECT_EQ(histogram.summary().max_us, 100.0 * 3600 * 1e6);
}

}  // namespace
}  // namespace lenticule::player
