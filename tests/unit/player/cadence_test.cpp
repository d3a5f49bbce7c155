// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "player/playback/pacing.h"

namespace lenticule::player {
namespace {

using frames::Rate;

TEST(LockedRate, HoldsContentWithinHalfAPercentToTheDisplay) {
  EXPECT_EQ(locked_rate({60, 1}, {60000, 1001}), (Rate{60000, 1001}));
  EXPECT_EQ(locked_rate({60000, 1001}, {60, 1}), (Rate{60, 1}));
  EXPECT_EQ(locked_rate({30, 1}, {60000, 1001}), (Rate{30000, 1001}));
  EXPECT_EQ(locked_rate({120, 1}, {60000, 1001}), (Rate{120000, 1001}));
  EXPECT_EQ(locked_rate({60, 1}, {6003, 100}), (Rate{6003, 100}));
}

TEST(LockedRate, GivesBroadcastRatesTheCadenceOfTheirSiblings) {
  EXPECT_EQ(locked_rate({24, 1}, {60000, 1001}), (Rate{24000, 1001}));
  EXPECT_EQ(locked_rate({24000, 1001}, {60, 1}), (Rate{24, 1}));
  EXPECT_EQ(locked_rate({25, 1}, {60000, 1001}), (Rate{25000, 1001}));
}

TEST(LockedRate, LeavesOtherRatesAsTheyAre) {
  for (const Rate rate : {Rate{24, 1}, Rate{25, 1}, Rate{50, 1}, Rate{241, 10}, Rate{59, 1}})
    EXPECT_EQ(locked_rate(rate, {60, 1}), rate) << frames::to_string(rate);
}

TEST(LockedRate, SurvivesAbsurdTerms) {
  const Rate absurd{9007199254740993, 150119987579016};
  EXPECT_EQ(locked_rate(absurd, {60, 1}), absurd);
  Cadence cadence(absurd, {9007199254740991, 150119987579017});
  for (int k = 0; k < 1000; ++k) cadence.advance();
  EXPECT_NEAR(static_cast<double>(cadence.due()), 1000.0, 1.0);
}

}  // namespace
}  // namespace lenticule::player
