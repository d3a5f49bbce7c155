// SPDX-License-Identifier: Apache-2.0
// Tests the whole procedure with a scripted observer who sees only what the sheet shows: the result
// must be the true sheet.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "optics/rig.h"
#include "optics/rig_file.h"
#include "tests/unit/calib/by_eye/scripted_observer.h"

namespace lenticule::calib::test {
namespace {

struct Case {
  double pitch_subpx;
  double slant;
  double offset_lenses;
  double gap_mm;
  double distance_mm;
  double pitch_error;
  double slant_error_degrees;
  double gap_error;
};

/// Returns a rig of 4K at 27 inches with as many lenses as a real panel.
optics::Rig true_rig(const Case& c) {
  optics::Rig rig =
      optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/kiosk-27-4k.toml");
  rig.sheet.pitch = Subpixels(c.pitch_subpx);
  rig.sheet.slant = c.slant;
  rig.sheet.offset = Lenses(c.offset_lenses);
  rig.sheet.gap = Millimetres(c.gap_mm);
  rig.viewing.distance = Millimetres(c.distance_mm);
  return rig;
}

optics::Rig wrong_rig(const Case& c) {
  optics::Rig rig = true_rig(c);
  rig.sheet.pitch = rig.sheet.pitch * (1.0 + c.pitch_error);
  rig.sheet.slant = std::tan(std::atan(c.slant) + c.slant_error_degrees * std::numbers::pi / 180.0);
  rig.sheet.offset = Lenses(0.1);
  rig.sheet.gap = rig.sheet.gap * (1.0 + c.gap_error);
  return rig;
}

double degrees(double slant) {
  return std::atan(slant) * 180.0 / std::numbers::pi;
}

void expect_near(const SheetValues& found, const SheetValues& wanted) {
  EXPECT_NEAR(found.effective_pitch_subpx / wanted.effective_pitch_subpx, 1.0, 3e-5);
  EXPECT_NEAR(degrees(found.slant), degrees(wanted.slant), 0.01);
  EXPECT_NEAR(
      optics::without_whole_lenses(found.effective_offset_lenses - wanted.effective_offset_lenses),
      0.0, 0.02);
}

/// One sheet only: each look at a whole chart takes a while.
TEST(ByEyeQuestions, FindTheSheet) {
  const Case c = {7.701, 0.2521, -0.44, 2.238, 700, -0.03, -1.0, 0.05};
  const optics::Rig ground_truth = true_rig(c);
  Procedure procedure(wrong_rig(c), c.distance_mm, Doubts::Accept);
  procedure.press({Key::Next});
  ScriptedObserver observer(ground_truth, procedure);
  observer.answer_questions();
  ASSERT_EQ(procedure.step(), Step::Offset);
  EXPECT_LE(procedure.questions().answers(), 30);

  const SheetValues wanted = sheet_values(ground_truth, c.distance_mm);
  const SheetValues found = sheet_values(procedure.rig(), c.distance_mm);
  expect_near(found, wanted);
}

Case right_but_for_the_gap(double gap_error) {
  return {7.701, 0.2521, 0.1, 2.238, 700, 0.0, 0.0, gap_error};
}

/// Returns a procedure with the sheet that looks right from the first distance.
Procedure at_gap_step(const Case& c, Step step) {
  SheetValues values = sheet_values(true_rig(c), c.distance_mm);
  values.gap_mm *= 1.0 + c.gap_error;
  Procedure procedure(with_sheet_values(true_rig(c), values, c.distance_mm), c.distance_mm);
  for (int n = 0; n < 100 && procedure.step() < Step::Offset; ++n) procedure.press({Key::Next});
  procedure.press({Key::Restore});
  for (int n = 0; n < kSteps && procedure.step() != step; ++n) procedure.press({Key::Next});
  return procedure;
}

TEST(ByEyeGap, ZonesGiveTheGapWithinTwoPercent) {
  const Case c = right_but_for_the_gap(0.15);
  Procedure procedure = at_gap_step(c, Step::GapByFlips);
  ASSERT_GT(std::abs(procedure.rig().sheet.gap.value / c.gap_mm - 1.0), 0.1);
  ScriptedObserver(true_rig(c), procedure).find_gap_by_flips();
  EXPECT_TRUE(procedure.gap_was_found());
  EXPECT_NEAR(procedure.rig().sheet.gap.value / c.gap_mm, 1.0, 0.02);
  EXPECT_NEAR(procedure.rig().sheet.pitch.value / c.pitch_subpx, 1.0, 1e-4);
}

TEST(ByEyeGap, ASecondDistanceGivesTheGapWithinFivePercent) {
  const Case c = right_but_for_the_gap(-0.15);
  Procedure procedure = at_gap_step(c, Step::GapByDistance);
  const SheetValues before = sheet_values(procedure.rig(), c.distance_mm);
  ScriptedObserver(true_rig(c), procedure).find_gap_by_distance();
  EXPECT_NEAR(procedure.rig().sheet.gap.value / c.gap_mm, 1.0, 0.05);
  EXPECT_NEAR(procedure.rig().sheet.pitch.value / c.pitch_subpx, 1.0, 1e-4);
  const SheetValues after = sheet_values(procedure.rig(), c.distance_mm);
  EXPECT_NEAR(after.effective_pitch_subpx / before.effective_pitch_subpx, 1.0, 1e-12);
}

}  // namespace
}  // namespace lenticule::calib::test
