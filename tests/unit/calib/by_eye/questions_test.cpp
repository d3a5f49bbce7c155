// SPDX-License-Identifier: Apache-2.0
// Tests the questions of calibration by eye: which charts they show, that wrong answers are asked
// again, and the keys that answer them.
#include "calib/by_eye/questions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "calib/by_eye/procedure.h"
#include "optics/rig_file.h"

namespace lenticule::calib {
namespace {

using frames::band_scale;
using frames::band_shift;
using frames::kBands;
using testing::HasSubstr;

constexpr int kNone = -1;
constexpr double kDistance = 700.0;

optics::Rig kiosk() {
  return optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/kiosk-27-4k.toml");
}

/// Returns the band nearest to the true value.
int nearest(const std::function<double(int)>& error_of) {
  int best = 0;
  for (int band = 1; band < kBands; ++band)
    if (std::abs(error_of(band)) < std::abs(error_of(best))) best = band;
  const double step = std::abs(error_of(1) - error_of(0));
  return std::abs(error_of(best)) <= step ? best : kNone;
}

/// Answers paraxially for a sheet with these values.
int right_answer(const Question& question, const SheetValues& sheet, const optics::Panel& panel) {
  const SheetValues& shown = question.sheet;
  const auto phase = [&](const SheetValues& of, double x, double y) {
    return 3.0 * (x * panel.width_px + of.slant * y * panel.height_px) / of.effective_pitch_subpx +
           of.effective_offset_lenses;
  };
  return nearest([&](int band) {
    switch (question.pattern) {
      case ChartPattern::Bands:
        return shown.effective_pitch_subpx * band_scale(band, question.reach) -
               sheet.effective_pitch_subpx;
      case ChartPattern::SlantBands:
        return shown.slant + band_shift(question.pattern, band, question.reach) - sheet.slant;
      default: {
        const double y = frames::rung_y(question.ladder_y, band);
        const double off = phase(sheet, question.ladder_x, y) - phase(shown, question.ladder_x, y) -
                           band_shift(question.pattern, band, question.reach);
        return off - std::round(off);
      }
    }
  });
}

SheetValues true_values() {
  SheetValues values = sheet_values(kiosk(), kDistance);
  values.effective_pitch_subpx *= 1.0437;
  values.slant -= 0.031;
  values.effective_offset_lenses += 0.37;
  return values;
}

/// Answers all questions, but the n-th ones with a band that is five off.
void answer_all(Questions& questions, const std::vector<int>& wrong) {
  for (int n = 0; n < 100 && !questions.is_done(); ++n) {
    const int right = right_answer(questions.question(), true_values(), kiosk().panel);
    const bool is_wrong = std::find(wrong.begin(), wrong.end(), n) != wrong.end();
    questions.answer(is_wrong ? (right + 5) % kBands : right);
  }
}

void expect_found(const Questions& questions) {
  ASSERT_TRUE(questions.is_done());
  const SheetValues found = questions.values(), wanted = true_values();
  const double lenses_across = 3.0 * kiosk().panel.width_px / wanted.effective_pitch_subpx;
  const double ratio = found.effective_pitch_subpx / wanted.effective_pitch_subpx;
  EXPECT_NEAR((ratio - 1.0) * lenses_across, 0.0, 0.02);
  EXPECT_NEAR((found.slant - wanted.slant) * lenses_across * kiosk().panel.height_px /
                  kiosk().panel.width_px,
              0.0, 0.02);
  const double offset = found.effective_offset_lenses - wanted.effective_offset_lenses;
  EXPECT_NEAR(offset - std::round(offset), 0.0, 0.01);
}

TEST(Questions, FindTheSheetAlthoughAnyOneAnswerIsWrong) {
  int noticed = 0;
  for (int wrong = 0; wrong < 20; ++wrong) {
    SCOPED_TRACE(wrong);
    Questions questions(kiosk(), kDistance);
    answer_all(questions, {wrong});
    expect_found(questions);
    noticed += questions.contradictions() > 0 ? 1 : 0;
  }
  EXPECT_GT(noticed, 10) << "the user is told";
}

TEST(Questions, UndoForgetsTheLastAnswer) {
  Questions questions(kiosk(), kDistance);
  EXPECT_FALSE(questions.undo());
  std::vector<SheetValues> values;
  for (int n = 0; n < 12; ++n) {
    values.push_back(questions.question().sheet);
    questions.answer(right_answer(questions.question(), true_values(), kiosk().panel));
  }
  for (int n = 12; n-- > 0;) {
    EXPECT_TRUE(questions.undo());
    EXPECT_EQ(questions.question().sheet, values[static_cast<size_t>(n)]) << n;
  }
  EXPECT_EQ(questions.answers(), 0);
}

TEST(Questions, StartAgainIfLadderAfterLadderShowsNoTurn) {
  Questions questions(kiosk(), kDistance);
  for (int n = 0; n < 30 && questions.question().pattern != ChartPattern::Ladder; ++n)
    questions.answer(right_answer(questions.question(), true_values(), kiosk().panel));
  ASSERT_EQ(questions.question().pattern, ChartPattern::Ladder);
  for (int n = 0; n < 3; ++n) questions.answer(kNone);
  EXPECT_EQ(questions.question().pattern, ChartPattern::Bands);
  answer_all(questions, {});
  expect_found(questions);
}

/// Any answers give charts of valid rigs, also from starts at the limits of a rig.
TEST(Questions, ShowValidRigsForAnyAnswers) {
  std::mt19937 random(5);
  for (const double pitch : {1.6, 7.7, 300.0})
    for (const double slant : {-3.9, 0.0, 3.9}) {
      optics::Rig rig = kiosk();
      rig.sheet.pitch = Subpixels(pitch);
      rig.sheet.slant = slant;
      rig.sheet.gap = Millimetres(5.5 * pitch * rig.panel.pixel_width.value / 3.0);
      Procedure procedure(rig, kDistance, Doubts::Ask);
      procedure.press({Key::Next});
      for (int n = 0; n < 60 && procedure.is_asking(); ++n) {
        const int presses = static_cast<int>(random() % 13);
        const Key key = random() % 2 == 0 ? Key::Up : Key::Down;
        for (int k = 0; k < presses; ++k) procedure.press({key});
        procedure.press({Key::Next});
        ASSERT_EQ(optics::find_problem(procedure.rig()), std::nullopt);
        ASSERT_EQ(optics::find_problem(procedure.chart().rig), std::nullopt);
      }
    }
}

// --- keys -------------------------------------------------------------------------------------

/// Returns a procedure at its first question.
Procedure asking(Doubts doubts = Doubts::Ask) {
  Procedure procedure(kiosk(), kDistance, doubts);
  EXPECT_FALSE(procedure.is_asking());
  procedure.press({Key::Next});
  EXPECT_TRUE(procedure.is_asking());
  return procedure;
}

/// Answers until the procedure asks no more, or asks about a doubt.
void answer_all(Procedure& procedure, const SheetValues& sheet) {
  for (int n = 0; n < 100 && procedure.is_asking() && !procedure.questions().is_done(); ++n) {
    const int band = right_answer(procedure.questions().question(), sheet, kiosk().panel);
    for (int k = kBands / 2; k < band; ++k) procedure.press({Key::Down});
    for (int k = kBands / 2; k > band; --k) procedure.press({Key::Up});
    procedure.press({Key::Next});
  }
}

TEST(QuestionKeys, AnswersLeadToTheOffsetStepWithTheFoundSheet) {
  SheetValues sheet = sheet_values(kiosk(), kDistance);
  sheet.effective_pitch_subpx *= 1.01;
  Procedure procedure = asking();
  answer_all(procedure, sheet);
  EXPECT_EQ(procedure.step(), Step::Offset);
  EXPECT_NEAR(
      sheet_values(procedure.rig(), kDistance).effective_pitch_subpx / sheet.effective_pitch_subpx,
      1.0, 2e-5);
  for (int n = 0; n < kSteps && procedure.status() == Procedure::Status::Running; ++n)
    procedure.press({Key::Next});
  EXPECT_EQ(procedure.status(), Procedure::Status::Saved);
}

TEST(QuestionKeys, AskAboutAPitchFourPercentFromTheStart) {
  Procedure procedure = asking();
  SheetValues sheet = sheet_values(kiosk(), kDistance);
  sheet.effective_pitch_subpx *= 1.04;
  answer_all(procedure, sheet);
  EXPECT_TRUE(procedure.is_asking());
  EXPECT_THAT(procedure.note(), HasSubstr("differs by 4 % from"));
  EXPECT_THAT(procedure.note(), HasSubstr("ENTER once more"));
  EXPECT_EQ(procedure.chart().pattern, ChartPattern::TwoViews);
  procedure.press({Key::Next});
  EXPECT_EQ(procedure.step(), Step::Offset);
}

TEST(QuestionKeys, AskIfTheLaddersDoNotLieInAPlane) {
  for (const Doubts doubts : {Doubts::Ask, Doubts::Refuse}) {
    Procedure procedure = asking(doubts);
    SheetValues sheet = sheet_values(kiosk(), kDistance);
    for (int n = 0; n < 100 && procedure.is_asking() && !procedure.questions().is_done(); ++n) {
      // The sheet is bent: the middle is a tenth of a lens ahead.
      const Question question = procedure.questions().question();
      const bool middle = question.ladder_x == 0.0;
      sheet.effective_offset_lenses =
          sheet_values(kiosk(), kDistance).effective_offset_lenses + (middle ? 0.1 : 0.0);
      const int band = right_answer(question, sheet, kiosk().panel);
      for (int k = kBands / 2; k < band; ++k) procedure.press({Key::Down});
      for (int k = kBands / 2; k > band; --k) procedure.press({Key::Up});
      procedure.press({Key::Next});
    }
    EXPECT_THAT(procedure.doubt(), HasSubstr("not flat"));
    EXPECT_EQ(procedure.status(),
              doubts == Doubts::Refuse ? Procedure::Status::Refused : Procedure::Status::Running);
    EXPECT_NE(procedure.step(), Step::Offset);
  }
}

TEST(QuestionKeys, TheMarkLeavesTheChartForNoneOfTheBands) {
  Procedure procedure = asking();
  for (int n = 0; n < 30; ++n) procedure.press({Key::Up});
  EXPECT_EQ(procedure.chart().cursor, -1);
  EXPECT_THAT(procedure.numbers(), HasSubstr("none of them"));
  procedure.press({Key::Down, Stride::Coarse});
  EXPECT_EQ(procedure.chart().cursor, 4);
  procedure.press({Key::Next});
  EXPECT_EQ(procedure.questions().answers(), 1);
  EXPECT_EQ(procedure.chart().cursor, kBands / 2);
}

TEST(QuestionKeys, BackspaceForgetsTheLastAnswerAndEscapeAllAnswers) {
  Procedure procedure = asking();
  procedure.press({Key::Next});
  procedure.press({Key::Next});
  EXPECT_EQ(procedure.questions().answers(), 2);
  procedure.press({Key::Back});
  EXPECT_EQ(procedure.questions().answers(), 1);
  procedure.press({Key::Next});
  procedure.press({Key::Restore});
  EXPECT_EQ(procedure.questions().answers(), 0);
  procedure.press({Key::Back});
  EXPECT_EQ(procedure.step(), Step::Prepare);
}

TEST(QuestionKeys, AValueCanStillBeChangedByHandAfterTheQuestions) {
  Procedure procedure = asking();
  answer_all(procedure, sheet_values(kiosk(), kDistance));
  ASSERT_EQ(procedure.step(), Step::Offset);
  const double before = procedure.rig().sheet.offset.value;
  procedure.press({Key::Right});
  EXPECT_NEAR(procedure.rig().sheet.offset.value - before, kOffsetStepLenses, 1e-9);
  procedure.press({Key::Undo});
  procedure.press({Key::Undo});
  EXPECT_EQ(procedure.step(), Step::Offset);
  EXPECT_NEAR(procedure.rig().sheet.offset.value, before, 1e-12);
}

}  // namespace
}  // namespace lenticule::calib
