// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "render/methods/adaptive/audit.h"

namespace lenticule::render {
namespace {

/// Returns the bands that are tried if band n gains gain(n).
std::set<int> tried(int bands, const std::function<int64_t(int)>& gain) {
  BandOrder order(bands);
  std::set<int> all;
  for (std::vector<int> due = order.next(); !due.empty(); due = order.next())
    for (const int band : due) {
      EXPECT_TRUE(all.insert(band).second) << band;
      order.note(band, gain(band));
    }
  return all;
}

TEST(BandOrder, TriesEveryBandOnceIfAllGain) {
  for (const int bands : {1, 2, 7, 15, 16, 68, 135, 270})
    EXPECT_EQ(tried(bands, [](int) { return 10; }).size(), static_cast<size_t>(bands));
}

TEST(BandOrder, TriesBandsThatSeeNothing) {
  EXPECT_EQ(tried(68, [](int) { return 0; }).size(), 68U);
}

TEST(BandOrder, BeginsWithFewBandsSpreadOverTheFrame) {
  BandOrder large(135), small(15);
  EXPECT_EQ(large.next(), (std::vector{16, 48, 80, 112}));
  EXPECT_EQ(BandOrder(68).next(), (std::vector{16, 48}));
  EXPECT_EQ(BandOrder(40).next(), (std::vector{8, 24}));
  EXPECT_EQ(small.next(), (std::vector{8}));
}

TEST(BandOrder, StopsAfterTheFirstBandsIfAllLose) {
  BandOrder order(68);
  for (const int band : order.next()) order.note(band, -5);
  EXPECT_TRUE(order.loses());
  EXPECT_TRUE(order.next().empty());
}

TEST(BandOrder, ALaterGainReplacesAnEarlierOne) {
  BandOrder order(135);
  for (const int band : order.next()) order.note(band, 10);
  EXPECT_FALSE(order.loses());
  for (const int band : {16, 48, 80}) order.note(band, -4);
  EXPECT_TRUE(order.loses());
  order.note(80, 9);
  EXPECT_FALSE(order.loses());
}

TEST(BandOrder, DoesNotJudgeTheFrameByASingleBand) {
  BandOrder order(15);
  for (const int band : order.next()) order.note(band, -5);
  EXPECT_FALSE(order.loses());
}

TEST(BandOrder, GoesOnIfOneOfTwoFirstBandsGains) {
  const auto gain = [](int band) { return band == 16 ? -11 : 8; };
  BandOrder order(68);
  for (const int band : order.next()) order.note(band, gain(band));
  EXPECT_FALSE(order.loses());
  EXPECT_GE(tried(68, gain).size(), 40U);
}

TEST(BandOrder, LeavesBandsBetweenTwoThatLoseWhateverTheOthersGain) {
  const auto gain = [](int band) { return band >= 40 && band < 80 ? -1 : 100; };
  size_t wasted = 0;
  for (const int band : tried(135, gain)) wasted += gain(band) < 0 ? 1 : 0;
  EXPECT_LE(wasted, 6U + 4U);  // every eighth, and those beside the edges
}

TEST(BandOrder, LeavesTheLosingPartOfAFrame) {
  const auto gain = [](int band) { return band < 90 ? 10 : -8; };
  const std::set<int> all = tried(135, gain);
  size_t wasted = 0;
  for (const int band : all) wasted += gain(band) < 0 ? 1 : 0;
  EXPECT_EQ(all.size() - wasted, 90U);
  EXPECT_LE(wasted, 12U);
}

TEST(BandOrder, LeavesMostBandsIfOnlyTheFirstOnesGain) {
  const auto gain = [](int band) { return band % 32 == 16 ? 10 : -8; };
  EXPECT_LE(tried(135, gain).size(), 135U / 3);
}

}  // namespace
}  // namespace lenticule::render
