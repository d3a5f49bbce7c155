// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "player/step/step_member.h"

namespace lenticule::player {
namespace {

using std::chrono::microseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

TEST(StepClock, ContinuesWithoutTheStepsOfTheRealTimeClock) {
  StepClock clock({.monotonic = seconds(10), .real = seconds(5000)});
  EXPECT_EQ(clock.ahead_of_monotonic(), seconds(4990));
  const StepNow before = clock.now({.monotonic = seconds(11), .real = seconds(5001)});
  EXPECT_EQ(before.group, seconds(5001));
  EXPECT_EQ(before.stepped, nanoseconds{0});
  const StepNow after = clock.now({.monotonic = seconds(12), .real = seconds(5000)});
  EXPECT_EQ(after.group, seconds(5002));
  EXPECT_EQ(after.stepped, seconds(-2));
  (void)clock.now({.monotonic = seconds(13), .real = seconds(5001)});
  EXPECT_EQ(clock.steps(), 1u);
}

TEST(StepClock, AShortPauseBetweenTheTwoReadingsIsNoStep) {
  StepClock clock({.monotonic = seconds(10), .real = seconds(5000)});
  const StepNow now =
      clock.now({.monotonic = seconds(11), .real = seconds(5001) + microseconds(300)});
  EXPECT_EQ(now.stepped, nanoseconds{0});
  EXPECT_EQ(clock.steps(), 0u);
}

TEST(StepClock, TheKernelStatesItsAccuracy) {
  const ClockAccuracy accuracy = read_clock_accuracy();
  EXPECT_TRUE(accuracy.known);
  EXPECT_GE(accuracy.bound_us, 0);
}

}  // namespace
}  // namespace lenticule::player
