// SPDX-License-Identifier: Apache-2.0
// Tests a million vblanks of drivers that jitter, skip, wrap around and report wrong counts.
#include <gtest/gtest.h>

#include <random>

#include "display/kms/scanout/page_flip.h"

namespace lenticule::test {

using display::Nanoseconds;
using display::Vblank;
using display::VblankCounter;

constexpr Nanoseconds kPeriod{16'666'667};

TEST(VblankCounterLaw, CountsOfHonestDriversAreKeptExactly) {
  std::mt19937_64 random(4);
  uint64_t counted = random() % 1000 + 0xfff00000;
  Nanoseconds time = std::chrono::seconds(5);
  VblankCounter counter(VblankCounter::Source::Hardware, {60, 1}, {counted, time});
  for (int i = 0; i < 1'000'000; ++i) {
    const uint64_t step = random() % 100 == 0 ? random() % 1'000'000 : 1 + random() % 3;
    counted += step;
    time += static_cast<int64_t>(step) * kPeriod;
    const Nanoseconds heard = time + Nanoseconds(random() % 3'000'000);
    const Vblank vblank = counter.observe_low_bits(static_cast<uint32_t>(counted), time, heard);
    ASSERT_EQ(vblank.sequence, counted);
    ASSERT_EQ(vblank.time, time);
  }
}

TEST(VblankCounterLaw, WrongDriversNeverReverseSequenceOrTime) {
  std::mt19937_64 random(5);
  Nanoseconds now = std::chrono::seconds(5);
  VblankCounter counter(VblankCounter::Source::Hardware, {60, 1}, {0, now});
  Vblank last = counter.last();
  for (int i = 0; i < 1'000'000; ++i) {
    now += Nanoseconds(random() % 20'000'000);
    if (random() % 1000 == 0) counter.rebase(now);
    const auto time = random() % 2 == 0 ? now : Nanoseconds(static_cast<int64_t>(random() >> 2));
    const Vblank vblank = counter.observe_low_bits(static_cast<uint32_t>(random()), time, now);
    ASSERT_GE(vblank.sequence, last.sequence);
    ASSERT_GE(vblank.time, last.time);
    ASSERT_LE(vblank.time, now + std::chrono::milliseconds(50));
    last = vblank;
  }
}

TEST(VblankCounterLaw, TimeAndSequenceAreInverse) {
  std::mt19937_64 random(6);
  const VblankCounter counter(VblankCounter::Source::Software, {593407, 9900},
                              {77, std::chrono::seconds(3)});
  for (int i = 0; i < 100'000; ++i) {
    const uint64_t sequence = 77 + random() % 3'000'000'000;  // beyond 400 days
    const Vblank vblank = counter.at(sequence);
    ASSERT_EQ(counter.last_until(vblank.time).sequence, sequence);
    ASSERT_EQ(counter.first_from(vblank.time).sequence, sequence);
    ASSERT_EQ(counter.first_from(vblank.time + Nanoseconds{1}).sequence, sequence + 1);
  }
}

}  // namespace lenticule::test
