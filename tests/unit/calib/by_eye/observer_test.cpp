// SPDX-License-Identifier: Apache-2.0
// Tests the search for the gap with a scripted observer who sees only what the sheet shows: the
// result must be the true gap.
#include <gtest/gtest.h>

#include <cmath>

#include "optics/rig.h"
#include "optics/rig_file.h"
#include "tests/unit/calib/by_eye/scripted_observer.h"

namespace lenticule::calib::test {
namespace {

constexpr double kDistance = 700.0, kPitch = 7.701, kGap = 2.238;

/// Returns a rig of 4K at 27 inches with as many lenses as a real panel.
optics::Rig true_rig() {
  optics::Rig rig =
      optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/kiosk-27-4k.toml");
  rig.sheet.pitch = Subpixels(kPitch);
  rig.sheet.slant = 0.2521;
  rig.sheet.offset = Lenses(0.1);
  rig.sheet.gap = Millimetres(kGap);
  rig.viewing.distance = Millimetres(kDistance);
  return rig;
}

/// Returns a procedure with a sheet that looks right from the first distance, but for its gap.
Procedure at_gap_step(double gap_factor, Step step) {
  SheetValues values = sheet_values(true_rig(), kDistance);
  values.gap_mm *= gap_factor;
  Procedure procedure(with_sheet_values(true_rig(), values, kDistance), kDistance);
  for (int n = 0; n < 100 && procedure.step() < Step::Offset; ++n) procedure.press({Key::Next});
  procedure.press({Key::Restore});
  for (int n = 0; n < kSteps && procedure.step() != step; ++n) procedure.press({Key::Next});
  return procedure;
}

TEST(ByEyeGap, ZonesGiveTheGapWithinTwoPercent) {
  Procedure procedure = at_gap_step(1.15, Step::GapByFlips);
  ASSERT_GT(std::abs(procedure.rig().sheet.gap.value / kGap - 1.0), 0.1);
  ScriptedObserver(true_rig(), procedure).find_gap_by_flips();
  EXPECT_TRUE(procedure.gap_was_found());
  EXPECT_NEAR(procedure.rig().sheet.gap.value / kGap, 1.0, 0.02);
  EXPECT_NEAR(procedure.rig().sheet.pitch.value / kPitch, 1.0, 1e-4);
}

TEST(ByEyeGap, ASecondDistanceGivesTheGapWithinFivePercent) {
  Procedure procedure = at_gap_step(0.85, Step::GapByDistance);
  const SheetValues before = sheet_values(procedure.rig(), kDistance);
  ScriptedObserver(true_rig(), procedure).find_gap_by_distance();
  EXPECT_NEAR(procedure.rig().sheet.gap.value / kGap, 1.0, 0.05);
  EXPECT_NEAR(procedure.rig().sheet.pitch.value / kPitch, 1.0, 1e-4);
  const SheetValues after = sheet_values(procedure.rig(), kDistance);
  EXPECT_NEAR(after.effective_pitch_subpx / before.effective_pitch_subpx, 1.0, 1e-12);
}

}  // namespace
}  // namespace lenticule::calib::test
