// SPDX-License-Identifier: Apache-2.0
// Tests calibrations whose camera is not the same at all places, and known distances, on
// measurements made by formula.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calib/fit/calibrate.h"
#include "calib/fit/joint_fit.h"
#include "fit_stage.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

using test::FitStage;
using testing::HasSubstr;
using testing::Not;
using Own = std::array<OwnCameraValues, 3>;

FitStage stage_with(size_t view, const OwnCameraValues& own) {
  Own all{};
  all[view] = own;
  return FitStage(7, 0.004, all, 80.0);
}

Calibration calibrated(const FitStage& stage, CalibrateOptions options = {}) {
  options.map_columns = 6;
  options.map_rows = 4;
  return calibrate(stage.measurements(), stage.start_rig(), options);
}

std::string said(const Calibration& found) {
  std::string all;
  for (const std::string& reason : found.reasons) all += reason + "\n";
  for (const std::string& warning : found.warnings) all += warning + "\n";
  return all;
}

/// Returns the largest phase error of a rig at panel points, for eyes of the zone.
double worst_error(const optics::Rig& found, const FitStage& stage) {
  optics::Rig right = stage.start_rig();
  set_sheet(stage.ground_truth(), {}, {}, stage.panel(), right.sheet);
  const optics::OpticalModel a(found), b(right);
  double worst = 0.0;
  for (const double eye : {-250.0, 0.0, 250.0})
    for (const double x : {0.0, 0.5, 1.0})
      for (const double y : {0.0, 0.5, 1.0}) {
        const auto phase = [&](const optics::OpticalModel& model) {
          return model.phase(x * 3840.0, y * 2160.0, 1, {eye, 0.0, 700.0});
        };
        const double off = phase(a) - phase(b);
        worst = std::max(worst, std::abs(off - std::round(off)));
      }
  return worst;
}

TEST(OwnCameras, AShiftByTheStabiliserIsTakenIntoAccount) {
  const FitStage stage = stage_with(0, {0.0, 0.0016, -0.0012});
  const Calibration found = calibrated(stage);
  EXPECT_NE(found.verdict, Verdict::Refused) << said(found);
  EXPECT_LT(worst_error(found.rig, stage), 0.02);
  EXPECT_THAT(said(found), HasSubstr("centre: the axis of the camera"));
}

TEST(OwnCameras, FocusBreathingIsTakenIntoAccount) {
  const FitStage stage = stage_with(1, {0.015, 0.0, 0.0});
  const Calibration found = calibrated(stage);
  EXPECT_NE(found.verdict, Verdict::Refused) << said(found);
  EXPECT_LT(worst_error(found.rig, stage), 0.02);
  EXPECT_THAT(said(found), HasSubstr("left: the focal length is 1.5 % longer"));
}

TEST(OwnCameras, OneCameraForAllPlacesIsAssumedWithoutADifference) {
  const FitStage stage = stage_with(0, {});
  const Calibration found = calibrated(stage);
  EXPECT_EQ(found.verdict, Verdict::Intrinsic) << said(found);
  EXPECT_THAT(said(found), Not(HasSubstr("takes this into account")));
  EXPECT_LT(worst_error(found.rig, stage), 0.01);
}

TEST(OwnCameras, AZoomIsRefusedAndNoOtherPlaceIsBlamed) {
  const Calibration found = calibrated(stage_with(1, {0.06, 0.0, 0.0}));
  EXPECT_EQ(found.verdict, Verdict::Refused);
  ASSERT_EQ(found.reasons.size(), 1U) << said(found);
  EXPECT_THAT(found.reasons.front(), HasSubstr("left: the focal length is 6.0 % longer"));
  EXPECT_THAT(found.reasons.front(), Not(HasSubstr("centre")));
  EXPECT_THAT(found.reasons.front(), Not(HasSubstr("right")));
}

// A shift along the line of the places looks the same at each of them.
TEST(OwnCameras, ACroppedPlaceIsRefusedAndNamed) {
  const Calibration found = calibrated(stage_with(1, {0.0, 0.012, 0.0}));
  EXPECT_EQ(found.verdict, Verdict::Refused);
  ASSERT_EQ(found.reasons.size(), 1U) << said(found);
  EXPECT_THAT(found.reasons.front(), HasSubstr("left: the axis"));
}

TEST(Distances, CorrectTheDistanceOfASinglePlace) {
  const FitStage stage(9, 0.004, {}, 80.0);
  const auto eye = [&](const std::vector<Estimate>& distances) {
    const Calibration found =
        calibrate({stage.measurements().front()}, stage.start_rig(),
                  {.map_columns = 0, .map_rows = 0, .distances_mm = distances});
    EXPECT_EQ(found.verdict, Verdict::Effective) << said(found);
    return found.viewpoints.front();
  };
  EXPECT_GT(std::abs(eye({}).eye_mm.z - 700.0), 20.0);
  EXPECT_NEAR(eye({{700.0, 5.0}}).eye_mm.z, 700.0, 1.0);
  EXPECT_NEAR(eye({{700.0, 5.0}}).eye_sigma_mm.z, 5.0, 0.5);
}

TEST(Distances, AreComparedForEachPlaceAndAContradictionIsNamed) {
  const FitStage stage(9, 0.004, {}, 80.0);
  const Calibration right =
      calibrated(stage, {.distances_mm = {{702.0, 5.0}, {687.0, 5.0}, {721.0, 5.0}}});
  EXPECT_EQ(right.verdict, Verdict::Intrinsic) << said(right);
  const Calibration wrong = calibrated(stage, {.distances_mm = {{700.0, 5.0}, {740.0, 5.0}}});
  EXPECT_EQ(wrong.verdict, Verdict::Refused);
  ASSERT_EQ(wrong.reasons.size(), 1U) << said(wrong);
  EXPECT_THAT(wrong.reasons.front(), HasSubstr("left: the camera is 690 mm from the panel"));
  EXPECT_THAT(wrong.reasons.front(), HasSubstr("not 740 mm"));
}

}  // namespace
}  // namespace lenticule::calib
