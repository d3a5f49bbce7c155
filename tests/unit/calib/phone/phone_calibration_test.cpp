// SPDX-License-Identifier: Apache-2.0
// Hand-held photographs from the simulator of lenticule-bench, which shares no code with the fit.
#include "calib/phone/phone_calibration.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "lab/phone/hand_trial.h"
#include "tests/support/small_workshop.h"

namespace lenticule::calib {
namespace {

using lab::HandTrial;

using lab::HandOutcome;
using lab::HandResult;
using lab::HandTrial;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Calibration calibrate(const HandTrial& trial, const std::vector<PhonePhoto>& photos) {
  return calibrate_phone(photos, trial.chart(), trial.focal_px());
}

/// Photographs of one workshop, measured once for all tests.
const HandTrial& five_photographs() {
  static const HandTrial kTrial(101, test::small_workshop(5));
  return kTrial;
}

std::vector<PhonePhoto> first_photographs(size_t count) {
  const auto all = five_photographs().photos().begin();
  return {all, all + static_cast<ptrdiff_t>(count)};
}

TEST(PhoneCalibration, FindsTheSheetForEveryEye) {
  const HandTrial trial(101, test::small_workshop(6));
  for (const PhonePhoto& photo : trial.photos()) EXPECT_EQ(photo.findings.refusal, "");
  const Calibration found = calibrate(trial, trial.photos());
  EXPECT_EQ(found.verdict, Verdict::Intrinsic) << ::testing::PrintToString(found.reasons);
  EXPECT_THAT(found.warnings, IsEmpty());
  EXPECT_LT(trial.error_of(found.rig), HandTrial::kMostLenses);
  EXPECT_LT(trial.error_of(found.rig), found.drift.worst_lenses);
  EXPECT_GT(trial.error_of(trial.workshop().start), 0.2);
  ASSERT_EQ(found.viewpoints.size(), 6U);
  for (size_t n = 0; n < found.viewpoints.size(); ++n) {
    const Vec3 &seen = found.viewpoints[n].eye_mm, &real = trial.workshop().shots[n].eye_mm;
    EXPECT_NEAR(seen.x, real.x, 6.0) << n;
    EXPECT_NEAR(seen.y, real.y, 6.0) << n;
    EXPECT_NEAR(seen.z, real.z, 10.0) << n;
  }
  // Fewer photographs state a larger error, and what would help.
  const Calibration few = calibrate(trial, {trial.photos().begin(), trial.photos().begin() + 2});
  EXPECT_GT(few.drift.worst_lenses, found.drift.worst_lenses);
  EXPECT_EQ(few.verdict, Verdict::Refused);
  EXPECT_THAT(few.reasons, ElementsAre(HasSubstr("take one more from the upper right")));
}

// The picture of each phone of the lab is warped by up to 0.05 % of its width.
TEST(PhoneCalibration, AWarpIsNotTakenForAHandThatMoved) {
  lab::WorkshopLimits limits = lab::limits_for(1920, 3200);
  limits.least_warp = limits.most_warp = 0.0005;
  const HandResult found = HandTrial(13001, limits).calibrate(3);
  EXPECT_EQ(found.outcome, HandOutcome::Right)
      << found.error_lenses << ::testing::PrintToString(found.reasons);
}

TEST(PhoneCalibration, SmallPanelsAndWideLensesHaveFiveTags) {
  lab::WorkshopLimits limits = lab::limits_for(1280, 2400);
  limits.least_pitch_subpx = limits.most_pitch_subpx = 9.0;
  limits.shots = 4;
  const HandTrial trial(102, limits);
  EXPECT_EQ(trial.chart().tags.size(), 5U);
  const HandResult found = trial.calibrate(4);
  EXPECT_EQ(found.outcome, HandOutcome::Right)
      << found.error_lenses << ::testing::PrintToString(found.reasons);
}

/// Cuts a photograph at one side, and enlarges it by a tenth to the old size.
void crop(PhotoFindings& photo) {
  const auto moved = [](Vec2 pixel) { return (pixel - Vec2{60.0, 20.0}) * 1.1; };
  for (TagSighting& tag : photo.tags)
    for (Vec2& corner : tag.corners_px) corner = moved(corner);
  for (FringeBlock& block : photo.blocks) block.pixel = moved(block.pixel);
  photo.pose->focal_px *= 1.1;
  photo.pose->middle_px = moved(photo.pose->middle_px);
}

TEST(PhoneCalibration, PhotographsThatContradictEachOtherAreRefusedAndNamed) {
  const HandTrial trial(4, test::small_workshop(3));
  const auto reasons = [&](const auto& change) {
    std::vector<PhonePhoto> photos = trial.photos();
    change(photos[1].findings);
    const Calibration found = calibrate(trial, photos);
    EXPECT_EQ(found.verdict, Verdict::Refused);
    return found.reasons;
  };
  const auto moved_sheet = [](PhotoFindings& photo) {
    // Fringes of another slope, as if the sheet had turned on the panel.
    for (FringeBlock& block : photo.blocks) block.phase += 0.2 * block.y;
  };
  EXPECT_THAT(reasons(moved_sheet), ElementsAre(HasSubstr("photograph ")));
  EXPECT_THAT(reasons(crop), ElementsAre(HasSubstr("cropped")));
}

TEST(PhoneCalibration, APhotographThatSpoilsTheOthersIsSetAsideAndNamed) {
  const HandTrial& trial = five_photographs();
  const auto with_spoiled = [&](size_t place, const auto& change) {
    std::vector<PhonePhoto> photos = trial.photos();
    change(photos[place].findings);
    const Calibration found = calibrate(trial, photos);
    EXPECT_EQ(found.verdict, Verdict::Intrinsic) << ::testing::PrintToString(found.reasons);
    EXPECT_LT(trial.error_of(found.rig), HandTrial::kMostLenses);
    EXPECT_EQ(found.viewpoints.size(), 4U);
    EXPECT_EQ(found.set_aside.size(), 1U);
    if (found.set_aside.empty()) return std::string();
    EXPECT_EQ(found.set_aside[0].photograph, trial.photos()[place].name);
    return found.set_aside[0].reason;
  };
  const auto smaller = [](PhotoFindings& photo) { photo.width /= 2; };
  EXPECT_THAT(with_spoiled(0, smaller), HasSubstr("another size"));
  EXPECT_THAT(with_spoiled(2, smaller), HasSubstr("another size"));
  EXPECT_THAT(with_spoiled(1, crop), HasSubstr("cropped"));
}

// The fit does not show whether the sheet moved before the fourth or between the first three.
TEST(PhoneCalibration, ThreePhotographsDoNotAccuseTheFourthOfASheetThatMoved) {
  const auto with_moved = [](size_t count) {
    std::vector<PhonePhoto> photos = first_photographs(count);
    for (FringeBlock& block : photos.back().findings.blocks) block.phase += 0.2;
    return calibrate(five_photographs(), photos);
  };
  const Calibration four = with_moved(4);
  EXPECT_EQ(four.verdict, Verdict::Refused);
  EXPECT_THAT(four.reasons, ElementsAre(HasSubstr("the sheet moved on the panel by 0.20 lens")));
  const Calibration five = with_moved(5);
  EXPECT_EQ(five.verdict, Verdict::Intrinsic) << ::testing::PrintToString(five.reasons);
  ASSERT_EQ(five.set_aside.size(), 1U);
  EXPECT_EQ(five.set_aside[0].photograph, "photograph 5");
}

TEST(PhoneCalibration, FewerThanThreePhotographsOfTheWholeChartAreNotEnough) {
  const auto with_cut = [](size_t count) {
    std::vector<PhonePhoto> photos = first_photographs(count);
    photos.front().findings.covered = 0.7;
    return calibrate(five_photographs(), photos);
  };
  const Calibration three = with_cut(3);
  EXPECT_LT(three.drift.worst_lenses, HandTrial::kMostLenses);
  EXPECT_EQ(three.verdict, Verdict::Refused);
  EXPECT_THAT(three.reasons, ElementsAre(HasSubstr("photograph 1 shows 70 % of the chart")));
  EXPECT_EQ(with_cut(4).verdict, Verdict::Intrinsic);
}

const Parameter& parameter(const Calibration& calibration, const std::string& name) {
  const auto at = std::ranges::find(calibration.parameters, name, &Parameter::name);
  EXPECT_NE(at, calibration.parameters.end()) << name;
  return *at;
}

// The chart is white, and a sheet refracts blue light more than red light.
TEST(PhoneCalibration, TellsTheGapsOfTheColoursApart) {
  const HandTrial& trial = five_photographs();
  const Calibration found = calibrate(trial, first_photographs(3));
  EXPECT_THAT(found.warnings, ElementsAre(HasSubstr("3 photographs do not show")));
  const lab::Workshop& workshop = trial.workshop();
  const lab::SheetShape sheet(workshop.start.panel, workshop.build);
  const Vec2 across = sheet.lenses_at({}, 1).across();
  const auto shift = [&](int channel) {
    const double far = 1e7;
    const Vec3 eye{0.3 * far * across.x, 0.3 * far * across.y, far};
    return true_view(sheet, {}, channel, eye, lab::LightMiddle::Centroid)->phase -
           sheet.lenses_at({}, 1).coordinate;
  };
  const double green = found.rig.sheet.gap.value;
  EXPECT_NEAR(parameter(found, "gap_mm.red").estimate.value / green, shift(0) / shift(1), 8e-4);
  EXPECT_NEAR(parameter(found, "gap_mm.blue").estimate.value / green, shift(2) / shift(1), 8e-4);
  EXPECT_LT(shift(2) / shift(1), 0.997);
}

TEST(PhoneCalibration, OnePhotographIsNotEnough) {
  std::vector<PhonePhoto> photos(2);
  photos[0].name = "photograph 1";
  photos[1].name = "photograph 2";
  photos[1].findings.refusal = "only 2 of 9 tags were found";
  const lab::Workshop workshop = draw_workshop(4, test::small_workshop(1));
  const Calibration found =
      calibrate_phone(photos, plan_single_photo_chart(workshop.start), {2400.0, 72.0});
  EXPECT_EQ(found.verdict, Verdict::Refused);
  EXPECT_THAT(found.reasons, ElementsAre(HasSubstr("only 1 of 2 photographs"),
                                         HasSubstr("photograph 2: not used: only 2 of 9 tags")));
}

// A start that is 3 % off leaves a kind of band without fringes.
TEST(PhoneCalibration, AsksForABetterStartIfThePitchIsFarOff) {
  const HandTrial trial(4, test::small_workshop(1));
  const PhotoFindings& seen = trial.photos()[0].findings;
  EXPECT_FALSE(better_start(seen, trial.chart()));
  SinglePhotoChart far = trial.chart();
  far.start.sheet.pitch.value *= 1.03;
  const auto better = better_start(seen, far);
  ASSERT_TRUE(better);
  EXPECT_NEAR(better->sheet.pitch.value, trial.workshop().build.pitch_subpx,
              0.005 * trial.workshop().build.pitch_subpx);
}

TEST(PhoneCalibration, ReturnsNoStartWhoseChartHasNoRoomOnThePanel) {
  const lab::Workshop workshop = draw_workshop(4, test::small_workshop(1));
  PhotoFindings mistaken;
  mistaken.rig = workshop.start;
  mistaken.rig.sheet.pitch.value = 40.0;
  EXPECT_FALSE(better_start(mistaken, plan_single_photo_chart(workshop.start)));
}

// LENTICULE_PHONE_WORKSHOPS and LENTICULE_PHONE_FIRST draw more workshops, or others.
TEST(PhoneWorkshops, MostAreRightAndNoneIsWrong) {
  const auto number = [](const char* name, uint64_t usual) {
    const char* text = std::getenv(name);
    return text ? std::strtoull(text, nullptr, 10) : usual;
  };
  const uint64_t first = number("LENTICULE_PHONE_FIRST", 101);
  const uint64_t count = number("LENTICULE_PHONE_WORKSHOPS", 3);
  uint64_t right = 0;
  for (uint64_t seed = first; seed < first + count; ++seed) {
    const HandTrial trial(seed, test::small_workshop(6));
    const lab::HandResult result = trial.calibrate(6);
    fmt::print("workshop {}: {}, error {:.4f}, stated {:.4f} lens {}\n", seed,
               to_string(result.outcome), result.error_lenses, result.stated_lenses,
               result.reasons.empty() ? "" : result.reasons.front());
    EXPECT_NE(result.outcome, lab::HandOutcome::Wrong) << "workshop " << seed;
    right += result.outcome == lab::HandOutcome::Right ? 1 : 0;
  }
  EXPECT_GE(3 * right, 2 * count);
}

}  // namespace
}  // namespace lenticule::calib
