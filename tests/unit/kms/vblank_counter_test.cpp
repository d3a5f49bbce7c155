// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "display/kms/scanout/vblank_clock.h"

namespace lenticule::test {

using display::Nanoseconds;
using display::Vblank;
using display::VblankCounter;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr frames::Rate kSixty{60, 1};

TEST(VblankCounter, ExtendsThirtyTwoBitsAcrossEveryWrap) {
  VblankCounter counter(VblankCounter::Source::Hardware, kSixty, {0, seconds(1)});
  uint64_t expected = 0;
  Nanoseconds time = seconds(1);
  for (int i = 0; i < 40; ++i) {  // ten wraps
    expected += 0x40000000;
    time += milliseconds(10);
    EXPECT_EQ(counter.observe_low_bits(static_cast<uint32_t>(expected), time, time).sequence,
              expected);
  }
}

TEST(VblankCounter, NeverRunsBackwards) {
  VblankCounter counter(VblankCounter::Source::Hardware, kSixty, {1000, seconds(1)});
  EXPECT_EQ(counter.observe_low_bits(900, seconds(2), seconds(2)).sequence, 1000U);
  EXPECT_EQ(counter.observe_low_bits(1001, seconds(1), seconds(3)).time, counter.last().time);
}

TEST(VblankCounter, CorrectsImpossibleTimes) {
  VblankCounter counter(VblankCounter::Source::Hardware, kSixty, {10, seconds(10)});
  const Nanoseconds now = seconds(10) + milliseconds(40);
  for (const Nanoseconds wrong : {Nanoseconds{0}, Nanoseconds(seconds(999)), Nanoseconds{-5}}) {
    VblankCounter fresh = counter;
    const Vblank vblank = fresh.observe_low_bits(12, wrong, now);
    EXPECT_EQ(vblank.sequence, 12U);
    EXPECT_GE(vblank.time, seconds(10));
    EXPECT_LE(vblank.time, now);
  }
}

TEST(VblankCounter, ContinuesAfterAReset) {
  VblankCounter counter(VblankCounter::Source::Hardware, kSixty, {5000, seconds(100)});
  counter.rebase(seconds(101));
  const Vblank vblank = counter.observe_low_bits(3, seconds(101), seconds(101));
  EXPECT_EQ(vblank.sequence, 5060U);
  EXPECT_EQ(counter.driver_sequence(vblank.sequence + 1), 4U);
}

TEST(VblankCounter, CountsByTimeWithoutADriversCount) {
  VblankCounter counter(VblankCounter::Source::Software, kSixty, {0, seconds(1)});
  EXPECT_EQ(counter.first_from(seconds(2)).sequence, 60U);
  EXPECT_EQ(counter.first_from(seconds(2) + Nanoseconds{1}).sequence, 61U);
  EXPECT_EQ(counter.last_until(seconds(2)).sequence, 60U);
  EXPECT_EQ(counter.at(120).time, seconds(3));
}

TEST(VblankCounter, SwitchesToTimeWithoutAJump) {
  VblankCounter counter(VblankCounter::Source::Hardware, kSixty, {700, seconds(1)});
  counter.use_software(seconds(2));
  EXPECT_EQ(counter.last_until(seconds(2)).sequence, 760U);
  EXPECT_EQ(counter.first_from(seconds(3)).sequence, 820U);
}

}  // namespace lenticule::test
