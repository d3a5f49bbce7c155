// SPDX-License-Identifier: Apache-2.0
// Tests whole calibrations on the simulated bench, at small size.
#include "calib/fit/calibrate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lab/panel/trial.h"

namespace lenticule::calib {
namespace {

using lab::Trial;

Trial small_trial() {
  Trial trial = lab::plain_trial(1280, 720, 640, 360);
  trial.camera.samples = 6;
  trial.link_and_spot = false;
  return trial;
}

TEST(Calibrate, ThreeViewpointsFindTheSheetForEveryEye) {
  Trial trial = small_trial();
  trial.sheet.deformation_lenses = 0.08;
  const lab::TrialResult result = run_trial(trial);
  ASSERT_EQ(result.failure, "");
  EXPECT_EQ(result.calibration.verdict, Verdict::Intrinsic)
      << (result.calibration.reasons.empty() ? "" : result.calibration.reasons.front());
  // The law of the chief ray is extrapolated, with a warning, to angles steeper than any
  // viewpoint's.
  EXPECT_LT(result.errors.worst_lenses, 0.02);
  EXPECT_FALSE(result.calibration.warnings.empty());
  for (const Viewpoint& viewpoint : result.calibration.viewpoints)
    EXPECT_LT(viewpoint.predicted_lenses, 0.05) << viewpoint.name;
  EXPECT_LT(std::abs(result.errors.gap), 0.01);
  EXPECT_LT(result.errors.map_rms_lenses, 0.005);
  EXPECT_LT(std::abs(result.errors.slant), 2e-5);
  EXPECT_EQ(result.calibration.viewpoints.size(), 3U);
  EXPECT_EQ(result.calibration.rig.sheet.residual.columns, 24);
}

TEST(Calibrate, StatesThatOneViewpointIsValidOnlyForItsEye) {
  Trial trial = small_trial();
  trial.viewpoints.resize(1);
  const lab::TrialResult result = run_trial(trial);
  ASSERT_EQ(result.failure, "");
  EXPECT_EQ(result.calibration.verdict, Verdict::Effective);
  ASSERT_EQ(result.errors.effective_pitch.size(), 1U);
  EXPECT_LT(std::abs(result.errors.effective_pitch[0]), 2e-5);
  // The fit keeps the wrong gap of the start.
  EXPECT_DOUBLE_EQ(result.calibration.rig.sheet.gap.value, trial.start.sheet.gap.value);
}

TEST(Calibrate, RefusesAnEmptyMeasurement) {
  const Calibration found = calibrate({}, small_trial().start, {});
  EXPECT_EQ(found.verdict, Verdict::Refused);
  ASSERT_FALSE(found.reasons.empty());
}

}  // namespace
}  // namespace lenticule::calib
