// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "calib/phone/phone_fit.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

constexpr double kEven = 3.0;  ///< evidence at which both kinds of hand are as likely

optics::Rig start() {
  optics::Rig rig;
  rig.name = "turned";
  rig.panel.width_px = 1920;
  rig.panel.height_px = 1080;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.3);
  rig.sheet.pitch = Subpixels(5.0);
  rig.sheet.gap = Millimetres(1.5);
  return rig;
}

PhoneFit still(size_t photographs) {
  PhoneFit fit;
  fit.grid = {.columns = 13, .rows = 8};
  fit.values.sheet = sheet_start(start()).values;
  fit.values.knots.assign(static_cast<size_t>(fit.grid.count()), 0.0);
  fit.values.poses.resize(photographs);
  fit.photos.resize(photographs);
  const auto count = static_cast<Eigen::Index>(kSheetCount + fit.grid.count());
  fit.covariance = Eigen::MatrixXd::Zero(count, count);
  return fit;
}

/// Adds a fit whose phases differ by `lenses` everywhere.
void add_turned(PhoneFit& fit, size_t photo, double evidence, double lenses) {
  PhoneFit turned = still(fit.photos.size());
  turned.values.sheet[kOffset] += lenses;
  fit.turned.push_back({photo, 0.001, evidence, turned});
}

const TurnedFit* doubted(const PhoneFit& fit) {
  return possibly_moved_hand(fit, averaged_over_turns(fit), start(), {{0.0, 0.0, 700.0}});
}

TEST(HandTurn, TheMeanOfTwoEquallyLikelyHandsIsHalfway) {
  PhoneFit fit = still(3);
  add_turned(fit, 1, kEven, 0.004);
  const PhoneFit mean = averaged_over_turns(fit);
  EXPECT_NEAR(mean.values.sheet[kOffset] - fit.values.sheet[kOffset], 0.002, 1e-12);
  EXPECT_NEAR(mean.covariance(kOffset, kOffset), 0.002 * 0.002, 1e-12);
}

TEST(HandTurn, ARotationIsDoubtedByItsProbabilityTimesTheChangeThatTheMeanLeavesOut) {
  PhoneFit large = still(3), small = still(3), unlikely = still(3);
  add_turned(large, 2, kEven, 0.004);  // 0.5 * 0.002 lens
  add_turned(small, 2, kEven, 0.002);
  add_turned(unlikely, 2, kEven - 5.0, 0.02);
  EXPECT_EQ(doubted(large), large.turned.data());
  EXPECT_EQ(doubted(small), nullptr);
  EXPECT_EQ(doubted(unlikely), nullptr);
}

TEST(HandTurn, TheDoubtNamesThePhotographOfTheLargestExpectedChange) {
  PhoneFit fit = still(3);
  add_turned(fit, 0, kEven, 0.006);
  add_turned(fit, 1, kEven, 0.03);
  add_turned(fit, 2, kEven, 0.005);
  ASSERT_NE(doubted(fit), nullptr);
  EXPECT_EQ(doubted(fit)->photo, 1U);
}

TEST(HandTurn, FourPhotographsLeaveNoDoubt) {
  PhoneFit fit = still(4);
  add_turned(fit, 1, kEven, 0.02);
  EXPECT_EQ(doubted(fit), nullptr);
}

TEST(HandTurn, AnEvidentRotationIsAcceptedOnlyIfItChangesNothing) {
  PhoneFit harmless = still(3), harmful = still(3);
  add_turned(harmless, 0, 20.0, 0.005);
  add_turned(harmful, 0, 20.0, 0.007);
  EXPECT_EQ(moved_hand(harmless, start(), {{0.0, 0.0, 700.0}}), nullptr);
  EXPECT_EQ(moved_hand(harmful, start(), {{0.0, 0.0, 700.0}}), harmful.turned.data());
}

}  // namespace
}  // namespace lenticule::calib
