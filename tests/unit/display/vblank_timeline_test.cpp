// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.h"
#include "display/clock.h"

namespace lenticule::display {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

TEST(VblankTimeline, CountsWholeSecondsExactly) {
  const VblankTimeline timeline(seconds(5), {60, 1});
  EXPECT_EQ(timeline.time_of(0), seconds(5));
  EXPECT_EQ(timeline.time_of(1), seconds(5) + Nanoseconds(16'666'666));
  EXPECT_EQ(timeline.time_of(60), seconds(6));
  EXPECT_EQ(timeline.period(), Nanoseconds(16'666'666));
}

TEST(VblankTimeline, DoesNotDriftIn400Days) {
  constexpr uint64_t kDays = 400;
  constexpr uint64_t kSeconds = kDays * 24 * 3600;
  for (const frames::Rate rate : {frames::Rate{60, 1}, frames::Rate{144, 1}, frames::Rate{1, 7}}) {
    const VblankTimeline timeline(Nanoseconds(123), rate);
    const auto vblanks = kSeconds * static_cast<uint64_t>(rate.numerator);
    EXPECT_EQ(timeline.time_of(vblanks), Nanoseconds(123) + kDays * hours(24) * rate.denominator);
    EXPECT_EQ(timeline.sequence_at(timeline.time_of(vblanks)), vblanks);
  }
  // 1001 seconds hold exactly 60000 vblanks of the broadcast rate.
  const VblankTimeline broadcast(Nanoseconds(0), {60000, 1001});
  EXPECT_EQ(broadcast.time_of(60000 * 34526), seconds(1001) * 34526);
}

TEST(VblankTimeline, TimesBeforeTheOriginBelongToVblankZero) {
  const VblankTimeline timeline(seconds(5), {60, 1});
  EXPECT_EQ(timeline.sequence_at(seconds(4)), 0u);
  EXPECT_EQ(timeline.sequence_at(seconds(5)), 0u);
}

TEST(VblankTimeline, RefusesRefreshRatesBeyondTheClocksResolution) {
  EXPECT_THROW(VblankTimeline(Nanoseconds(0), {(int64_t{1} << 40) + 1, int64_t{1} << 38}), Error);
}

}  // namespace
}  // namespace lenticule::display
