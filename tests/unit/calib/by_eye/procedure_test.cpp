// SPDX-License-Identifier: Apache-2.0
// Tests the procedure as a state machine: which values keys change and which they keep, and that no
// change is lost.
#include "calib/by_eye/procedure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "optics/model.h"
#include "optics/rig.h"

namespace lenticule::calib {
namespace {

using testing::HasSubstr;

constexpr double kDistance = 650.0;

optics::Rig small_rig() {
  optics::Rig rig;
  rig.name = "small";
  rig.panel.width_px = 320;
  rig.panel.height_px = 200;
  rig.panel.pixel_width = Millimetres(0.2);
  rig.panel.pixel_height = Millimetres(0.21);
  rig.sheet.pitch = Subpixels(8.1);
  rig.sheet.slant = 0.23;
  rig.sheet.offset = Lenses(0.2);
  rig.sheet.gap = Millimetres(3.0);
  rig.sheet.refraction_shape = 0.45;
  rig.viewing.distance = Millimetres(700.0);
  rig.viewing.height = Millimetres(40.0);
  return rig;
}

/// Returns a procedure at a step after the questions, with the values of the start.
Procedure at(Step step, Doubts doubts = Doubts::Ask) {
  Procedure procedure(small_rig(), kDistance, doubts);
  for (int n = 0; n < 100 && procedure.step() < Step::Offset; ++n) procedure.press({Key::Next});
  procedure.press({Key::Restore});
  for (int n = 0; n < kSteps && procedure.step() != step; ++n) procedure.press({Key::Next});
  EXPECT_EQ(procedure.step(), step);
  return procedure;
}

void press(Procedure& procedure, Key key, int times = 1, Stride stride = Stride::Normal) {
  for (int n = 0; n < times; ++n) procedure.press({key, stride});
}

TEST(Procedure, WithoutChangesGivesTheSameSheet) {
  Procedure procedure = at(Step::Save);
  const optics::Rig before = small_rig(), after = procedure.rig();
  EXPECT_NEAR(after.sheet.pitch.value, before.sheet.pitch.value, 1e-12);
  EXPECT_NEAR(after.sheet.offset.value, before.sheet.offset.value, 1e-12);
  EXPECT_EQ(after.sheet.slant, before.sheet.slant);
  EXPECT_EQ(after.sheet.gap, before.sheet.gap);
  EXPECT_EQ(after.viewing, before.viewing) << "where its viewers are is not found here";
  press(procedure, Key::Next);
  EXPECT_EQ(procedure.status(), Procedure::Status::Saved);
}

TEST(Procedure, ArrowsMoveOneValueByTheirStride) {
  Procedure procedure = at(Step::Check);
  const SheetValues before = sheet_values(procedure.rig(), kDistance);
  press(procedure, Key::Up);
  press(procedure, Key::Up, 1, Stride::Coarse);
  press(procedure, Key::Down, 1, Stride::Fine);
  SheetValues after = sheet_values(procedure.rig(), kDistance);
  EXPECT_NEAR(after.effective_pitch_subpx / before.effective_pitch_subpx,
              (1 + 1e-4) * (1 + 1e-3) * (1 - 1e-5), 1e-12);
  EXPECT_EQ(after.slant, before.slant);
  EXPECT_NEAR(after.effective_offset_lenses, before.effective_offset_lenses, 1e-9)
      << "what is seen in the middle stays";
  press(procedure, Key::Finer);
  press(procedure, Key::Right);
  after = sheet_values(procedure.rig(), kDistance);
  EXPECT_NEAR(after.effective_offset_lenses - before.effective_offset_lenses, 0.001, 1e-9);
  press(procedure, Key::SlantMore, 3, Stride::Coarse);
  const double tilt = (procedure.rig().sheet.slant - before.slant) * 0.2 / 0.21;
  EXPECT_NEAR(tilt * 180.0 / M_PI, 3 * 10 * 0.1 * 0.01, 1e-9);
}

TEST(Procedure, AChangedGapKeepsThePictureFromTheSamePlace) {
  Procedure procedure = at(Step::GapByFlips);
  const SheetValues before = sheet_values(procedure.rig(), kDistance);
  press(procedure, Key::Right, 2, Stride::Coarse);
  const optics::Rig rig = procedure.rig();
  const SheetValues after = sheet_values(rig, kDistance);
  EXPECT_LT(after.gap_mm, before.gap_mm) << "wider zones, thinner sheet";
  EXPECT_NEAR(after.effective_pitch_subpx, before.effective_pitch_subpx, 1e-12);
  EXPECT_NEAR(after.effective_offset_lenses, before.effective_offset_lenses, 1e-12);
  EXPECT_NEAR(rig.sheet.pitch.value * (1.0 + rig.sheet.gap.value / kDistance),
              before.effective_pitch_subpx, 1e-12);
  EXPECT_TRUE(procedure.gap_was_found());
}

/// Exact law: eyes one spacing apart see phases one lens apart.
TEST(SheetValues, SpacingAndGapAgreeWithTheOpticalModel) {
  const optics::Rig rig = small_rig();
  SheetValues values = sheet_values(rig, kDistance);
  for (const double gap : {0.9, 3.0, 7.5}) {
    values.gap_mm = gap;
    const double spacing = spacing_of_gap(rig, values, kDistance);
    EXPECT_NEAR(gap_of_spacing(rig, values, kDistance, spacing), gap, 1e-9);
    optics::Rig at_height = with_sheet_values(rig, values, kDistance);
    at_height.viewing.height = Millimetres(0.0);
    const optics::OpticalModel model(at_height);
    const double left = model.phase(160, 100, 1, {-0.5 * spacing, 0, kDistance});
    const double right = model.phase(160, 100, 1, {0.5 * spacing, 0, kDistance});
    EXPECT_NEAR(right - left, 1.0, 2.0 * gap / kDistance) << "but for Z against Z + g";
  }
}

TEST(Procedure, TheSecondDistanceChangesTheGapAlone) {
  Procedure procedure = at(Step::GapByDistance);
  const SheetValues before = sheet_values(procedure.rig(), kDistance);
  EXPECT_NEAR(procedure.eye_distance_mm(), 1.5 * kDistance, 1e-9);
  press(procedure, Key::Down, 3);
  const SheetValues after = sheet_values(procedure.rig(), kDistance);
  EXPECT_GT(after.gap_mm, before.gap_mm) << "a pitch that falls faster belongs to a thicker sheet";
  EXPECT_NEAR(after.effective_pitch_subpx, before.effective_pitch_subpx, 1e-12);
  press(procedure, Key::Left, 1, Stride::Coarse);
  EXPECT_NEAR(procedure.eye_distance_mm(), 1.5 * kDistance - 100.0, 1e-9);
  press(procedure, Key::Left, 100);
  EXPECT_GT(procedure.eye_distance_mm(), 1.05 * kDistance) << "never the same distance twice";
  EXPECT_THAT(procedure.note(), HasSubstr("too near"));
}

TEST(Procedure, SwappedEyesAreHalfALensApart) {
  Procedure procedure = at(Step::Offset);
  const double before = procedure.rig().sheet.offset.value;
  press(procedure, Key::SwapEyes);
  EXPECT_NEAR(std::abs(procedure.rig().sheet.offset.value - before), 0.5, 1e-9);
  press(procedure, Key::SwapEyes);
  EXPECT_NEAR(procedure.rig().sheet.offset.value, before, 1e-9);
}

TEST(Procedure, UndoAndRedoCoverEveryChange) {
  Procedure procedure = at(Step::Check);
  std::vector<optics::Rig> rigs = {procedure.rig()};
  const std::vector<Key> keys = {Key::Right, Key::Up, Key::SlantLess, Key::Down, Key::Left};
  for (const Key key : keys) {
    press(procedure, key);
    rigs.push_back(procedure.rig());
  }
  for (size_t n = keys.size(); n > 0; --n) {
    EXPECT_EQ(procedure.rig(), rigs[n]);
    press(procedure, Key::Undo);
  }
  EXPECT_EQ(procedure.rig(), rigs.front());
  press(procedure, Key::Redo, static_cast<int>(keys.size()));
  EXPECT_EQ(procedure.rig(), rigs.back());
  press(procedure, Key::Redo);
  EXPECT_EQ(procedure.note(), "nothing to redo");
}

TEST(Procedure, CompareShowsTheOldRigAndChangesNothing) {
  Procedure procedure = at(Step::Check);
  press(procedure, Key::Up, 5);
  const optics::Rig edited = procedure.rig();
  press(procedure, Key::Compare);
  EXPECT_EQ(procedure.chart().rig.sheet, small_rig().sheet);
  press(procedure, Key::Right);
  EXPECT_EQ(procedure.rig(), edited) << "an edit needs the step on the panel";
  EXPECT_EQ(procedure.chart().rig.sheet, edited.sheet);
}

TEST(Procedure, EscapeRestoresAndCanBeUndone) {
  Procedure procedure = at(Step::Check);
  const optics::Rig start = procedure.rig();
  press(procedure, Key::Up, 5);
  press(procedure, Key::Right, 2);
  const optics::Rig edited = procedure.rig();
  press(procedure, Key::Restore);
  EXPECT_EQ(procedure.rig(), start);
  EXPECT_EQ(procedure.step(), Step::Check);
  press(procedure, Key::Undo);
  EXPECT_EQ(procedure.rig(), edited);
}

TEST(Procedure, RefusesInvalidRigsWithAReason) {
  Procedure procedure = at(Step::Check);
  press(procedure, Key::Coarser, 2);
  for (int n = 0; n < 200; ++n) press(procedure, Key::Down, 1, Stride::Coarse);
  EXPECT_THAT(procedure.note(), HasSubstr("limit reached"));
  EXPECT_EQ(optics::find_problem(procedure.rig()), std::nullopt);
}

/// Enters zones of 25 mm where the start's are 117 mm apart.
void enter_narrow_zones(Procedure& procedure) {
  for (int n = 0; n < 200 && gap_of_spacing(small_rig(), sheet_values(procedure.rig(), kDistance),
                                            kDistance, 25.0) > procedure.rig().sheet.gap.value;
       ++n)
    press(procedure, Key::Left);
}

TEST(Procedure, AsksAgainBeforeItAcceptsAnImplausibleGap) {
  Procedure procedure = at(Step::GapByFlips);
  enter_narrow_zones(procedure);
  const double gap = procedure.rig().sheet.gap.value;
  ASSERT_GT(gap, 2.0 * small_rig().sheet.gap.value);
  press(procedure, Key::Next);
  EXPECT_EQ(procedure.step(), Step::GapByFlips);
  EXPECT_THAT(procedure.note(), HasSubstr("3.00 mm of the start"));
  EXPECT_THAT(procedure.note(), HasSubstr("ENTER once more"));
  press(procedure, Key::Right);
  press(procedure, Key::Next);
  EXPECT_EQ(procedure.step(), Step::GapByFlips) << "another value is another question";
  press(procedure, Key::Next);
  EXPECT_EQ(procedure.step(), Step::GapByDistance);
}

TEST(Procedure, RefusesUnconfirmedImplausibleValues) {
  const auto finished = [](Doubts doubts) {
    Procedure procedure = at(Step::GapByFlips, doubts);
    enter_narrow_zones(procedure);
    press(procedure, Key::Next, kSteps);
    return procedure.status();
  };
  EXPECT_EQ(finished(Doubts::Refuse), Procedure::Status::Refused);
  EXPECT_EQ(finished(Doubts::Accept), Procedure::Status::Saved);
}

TEST(Procedure, AsksAboutEveryValueThatIsFarFromItsStart) {
  const optics::Rig rig = small_rig();
  const SheetValues start = sheet_values(rig, kDistance);
  SheetValues values = start;
  EXPECT_EQ(doubt_of(rig, start, values), "");
  values.effective_pitch_subpx *= 1.1;
  values.slant += 0.05;
  values.gap_mm *= 1.3;
  EXPECT_EQ(doubt_of(rig, start, values), "") << "as far as a start may be off";
  values = start;
  values.effective_pitch_subpx *= 1.2;
  EXPECT_THAT(doubt_of(rig, start, values), HasSubstr("pitch"));
  values = start;
  values.slant += 0.15;
  EXPECT_THAT(doubt_of(rig, start, values), HasSubstr("slant"));
  values = start;
  values.gap_mm /= 2.0;
  EXPECT_THAT(doubt_of(rig, start, values), HasSubstr("gap"));
}

TEST(Procedure, AsksAboutAGapWithoutAViewingCone) {
  optics::Rig rig = small_rig();
  rig.sheet.gap = Millimetres(7.0);
  const SheetValues start = sheet_values(rig, kDistance);
  SheetValues values = start;
  EXPECT_EQ(doubt_of(rig, start, values), "");
  values.gap_mm = 8.0;
  EXPECT_THAT(doubt_of(rig, start, values), HasSubstr("viewing cone of 3.9 degrees"));
}

TEST(Procedure, EveryStepsInstructionsUseThePanelsFont) {
  for (int n = 0; n <= kSteps; ++n) {
    const Guide guide =
        guide_of(n < kSteps ? static_cast<Step>(n) : Step::Ladders, n == kSteps, 700, 1050);
    EXPECT_FALSE(guide.task.empty());
    EXPECT_FALSE(guide.keys.empty());
    EXPECT_FALSE(guide.wrong.empty());
    std::string all = guide.title + guide.task + guide.keys;
    for (const std::string& sentence : guide.wrong) all += sentence;
    for (const char c : all) EXPECT_TRUE(c >= ' ' && c <= '~') << guide.title;
    EXPECT_EQ(all.find('{'), std::string::npos) << guide.title;
  }
}

/// Any sequence of keys gives a chart of a valid rig.
TEST(Procedure, KeepsAValidRigForAnyKeys) {
  std::mt19937 random(11);
  const Procedure answered = at(Step::Offset);
  for (int run = 0; run < 12; ++run) {
    Procedure procedure = answered;
    for (int n = 0; n < 400 && procedure.status() == Procedure::Status::Running; ++n) {
      auto key = static_cast<Key>(random() % (static_cast<unsigned>(Key::Quit) + 1));
      if (key == Key::Quit) key = Key::Up;
      const auto stride = static_cast<Stride>(random() % 3);
      const auto times = random() % 20;
      for (auto t = times - times; t < times; ++t) procedure.press({key, stride});
      ASSERT_EQ(optics::find_problem(procedure.rig()), std::nullopt);
      ASSERT_EQ(optics::find_problem(procedure.chart().rig), std::nullopt);
      ASSERT_FALSE(procedure.numbers().empty());
    }
  }
}

}  // namespace
}  // namespace lenticule::calib
