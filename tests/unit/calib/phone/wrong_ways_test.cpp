// SPDX-License-Identifier: Apache-2.0
// Mistakes with photographs, from the simulator of lenticule-bench, which shares no code with the
// fit.
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "lab/phone/hand_trial.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/small_workshop.h"

namespace lenticule::bench {
namespace {

TEST(WrongWays, AMistakeInOnePhotographIsRefusedWithItsCause) {
  const test::ScratchFolder folder;
  lab::WrongWayTrial trial(2001, test::small_workshop(3), folder.path());
  for (const char* name :
       {"hand that turns by 8 degrees a second", "out of focus", "overexposed", "too far away",
        "beside the panel", "chart scaled by 5 %", "sheet moved by a fifth of a lens",
        "panel with blue on the left, rig of red", "panel with red above blue"}) {
    const auto way = std::ranges::find(lab::wrong_ways(), name, &lab::WrongWay::name);
    ASSERT_NE(way, lab::wrong_ways().end()) << name;
    const lab::WrongWayResult result = trial.calibrate(*way);
    EXPECT_EQ(result.outcome, lab::HandOutcome::Refused) << name << ": " << result.error_lenses;
    EXPECT_TRUE(result.cause_named) << name << ": " << result.reason;
  }
}

/// Three photographs hardly determine axis and rotation of each: in these setups the fit leaves
/// most of the mistake to the sheet.
TEST(WrongWays, AMistakeThatTheSheetTakesUpIsNotAcceptedInSilence) {
  const test::ScratchFolder folder;
  lab::WorkshopLimits limits = lab::limits_for(1920, 3200);
  limits.shots = 3;
  for (const auto& [seed, name] : {std::pair(3315U, "file turned by 180 degrees"),
                                   std::pair(3314U, "other axis: another phone"),
                                   std::pair(8001U, "hand that turns by 8 degrees a second")}) {
    const auto way = std::ranges::find(lab::wrong_ways(), name, &lab::WrongWay::name);
    ASSERT_NE(way, lab::wrong_ways().end()) << name;
    const lab::WrongWayResult result =
        lab::WrongWayTrial(seed, limits, folder.path()).calibrate(*way);
    EXPECT_EQ(result.outcome, lab::HandOutcome::Refused) << name << ": " << result.error_lenses;
  }
}

// In the third photograph, the squares of one of the two patches beat with the camera's pixels:
// they seem a third darker than they are.
TEST(WrongWays, SquaresThatBeatWithTheCameraAreNotTakenForAScaledChart) {
  lab::WorkshopLimits limits = lab::limits_for(1920, 3200);
  limits.shots = 3;
  const lab::HandTrial trial(12012, limits);
  for (const calib::PhonePhoto& photo : trial.photos())
    EXPECT_EQ(photo.findings.refusal, "") << photo.name;
}

}  // namespace
}  // namespace lenticule::bench
