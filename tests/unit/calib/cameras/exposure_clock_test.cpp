// SPDX-License-Identifier: Apache-2.0
// Tests times and numbers of pictures from valid and invalid timestamps of drivers.
#include <gtest/gtest.h>

#include <chrono>

#include "frames/capture/capture_stream.h"

namespace lenticule::calib {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Nanoseconds kNow = seconds{1000};

BufferStamp stamped(Nanoseconds time) { return {.sequence = 0, .time = time, .monotonic = true}; }

TEST(ExposureClock, CountsForwardFromTheStartOfTheExposure) {
  ExposureClock clock(milliseconds{20}, milliseconds{30});
  BufferStamp stamp = stamped(kNow - milliseconds{60});
  stamp.start_of_exposure = true;
  EXPECT_EQ(clock.exposed_at(stamp, kNow), kNow - milliseconds{35});
}

TEST(ExposureClock, AnUnknownExposureLastsAsLongAsAFrame) {
  ExposureClock clock(std::nullopt, milliseconds{30});
  EXPECT_EQ(clock.exposed_at(stamped(kNow), kNow), kNow - milliseconds{30});
}

TEST(ExposureClock, ReplacesTimestampsOfAnotherClock) {
  ExposureClock clock(milliseconds{20}, milliseconds{30});
  BufferStamp stamp = stamped(kNow - seconds{1});
  stamp.monotonic = false;
  EXPECT_EQ(clock.exposed_at(stamp, kNow), kNow - milliseconds{25});
  EXPECT_TRUE(clock.unreliable());
}

TEST(ExposureClock, ReplacesImpossibleTimestamps) {
  for (const Nanoseconds bad : {Nanoseconds{0}, kNow - seconds{11}, kNow + milliseconds{6}}) {
    ExposureClock clock(milliseconds{0}, milliseconds{0});
    EXPECT_EQ(clock.exposed_at(stamped(bad), kNow), kNow) << bad.count();
    EXPECT_TRUE(clock.unreliable());
  }
  ExposureClock clock(milliseconds{0}, milliseconds{0});
  EXPECT_EQ(clock.exposed_at(stamped(kNow - seconds{1}), kNow), kNow - seconds{1});
  EXPECT_EQ(clock.exposed_at(stamped(kNow - seconds{2}), kNow), kNow) << "it went back";
}

TEST(ExposureClock, AcceptsATimestampSlightlyAheadButNoPictureAhead) {
  ExposureClock clock(milliseconds{20}, milliseconds{30});
  EXPECT_EQ(clock.exposed_at(stamped(kNow + milliseconds{29}), kNow), kNow);
  EXPECT_EQ(clock.exposed_at(stamped(kNow + milliseconds{30}), kNow + milliseconds{10}),
            kNow + milliseconds{5});
  EXPECT_FALSE(clock.unreliable());
}

TEST(ExposureClock, TimesIncreaseWhenStampsBecomeUnusable) {
  ExposureClock clock(milliseconds{20}, milliseconds{30});
  const Nanoseconds first = clock.exposed_at(stamped(kNow + milliseconds{29}), kNow);
  EXPECT_GT(clock.exposed_at(stamped(Nanoseconds{0}), kNow + milliseconds{1}), first);
}

TEST(ExposureClock, ContinuesCountingWhenTheCounterRestarts) {
  ExposureClock clock(std::nullopt, Nanoseconds{0});
  EXPECT_EQ(clock.count(0xFFFFFFFEU), 0xFFFFFFFEU);
  EXPECT_EQ(clock.count(0xFFFFFFFFU), 0xFFFFFFFFU);
  EXPECT_EQ(clock.count(1), uint64_t{1} << 32 | 1U) << "0 was lost";
}

TEST(ExposureClock, CountsPicturesIfTheCounterStallsOrGoesBack) {
  ExposureClock clock(std::nullopt, Nanoseconds{0});
  EXPECT_EQ(clock.count(100), 100U);
  EXPECT_EQ(clock.count(100), 101U);
  EXPECT_EQ(clock.count(3), 102U);
  EXPECT_EQ(clock.count(4), 103U);
}

}  // namespace
}  // namespace lenticule::calib
