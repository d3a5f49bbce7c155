// SPDX-License-Identifier: Apache-2.0
// Answers the questions of calibration by eye for random sheets and starts, without and with wrong
// answers, and prints the table of docs/panel/calibrate-by-eye.md.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "optics/rig_file.h"
#include "tests/unit/calib/by_eye/answering_observer.h"

namespace lenticule::calib::test {
namespace {

constexpr int kRuns = 100;
constexpr int kMostAnswers = 150;

struct Setup {
  optics::Rig ground_truth;
  optics::Rig start;
};

/// Returns panels from 1080p to 8K with 5 to 16 subpixels a lens, and starts that are off by up to
/// 8 % of the pitch, 3 degrees and 10 % of the gap.
Setup random_setup(std::mt19937_64& random) {
  const auto between = [&](double least, double most) {
    return least + (most - least) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  optics::Rig rig =
      optics::load_rig(std::string(LENTICULE_SOURCE_DIR) + "/scenes/rigs/kiosk-27-4k.toml");
  const int scale = 1 << random() % 3;
  rig.panel.width_px = 1920 * scale;
  rig.panel.height_px = 1080 * scale;
  rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.311 / scale);
  const double distance = between(500.0, 1200.0);
  rig.viewing.distance = Millimetres(distance);
  rig.viewing.height = Millimetres(between(-40.0, 40.0));
  rig.sheet.pitch = Subpixels(between(5.0, 16.0));
  rig.sheet.slant = between(-0.35, 0.35);
  rig.sheet.offset = Lenses(between(-0.5, 0.5));
  const double zone_mm = between(80.0, 180.0);
  rig.sheet.gap =
      Millimetres(rig.sheet.pitch.value * rig.panel.pixel_width.value / 3.0 * distance / zone_mm);
  optics::Rig start = rig;
  start.sheet.pitch = start.sheet.pitch * (1.0 + between(-0.08, 0.08));
  start.sheet.slant =
      std::tan(std::atan(rig.sheet.slant) + between(-3.0, 3.0) * std::numbers::pi / 180.0);
  start.sheet.offset = Lenses(between(-0.5, 0.5));
  start.sheet.gap = start.sheet.gap * (1.0 + between(-0.1, 0.1));
  return {rig, start};
}

struct Outcome {
  bool accepted = false;
  double error_lenses = 0.0;
  int answers = 0;
  int presses = 0;
};

Outcome outcome_of(const Setup& setup, const Eyesight& eyesight, uint64_t seed) {
  const double distance = setup.ground_truth.viewing.distance.value;
  Procedure procedure(setup.start, distance, Doubts::Refuse);
  procedure.press({Key::Next});
  AnsweringObserver observer(setup.ground_truth, procedure, eyesight, seed);
  Outcome outcome;
  outcome.answers = observer.answer(kMostAnswers);
  outcome.presses = observer.presses();
  outcome.accepted = procedure.step() == Step::Offset;
  outcome.error_lenses = worst_error_lenses(procedure.rig(), setup.ground_truth);
  return outcome;
}

std::vector<Outcome> outcomes(const Eyesight& eyesight, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Outcome> all;
  for (int run = 0; run < kRuns; ++run) {
    const Setup setup = random_setup(random);
    all.push_back(outcome_of(setup, eyesight, random()));
  }
  return all;
}

template <class Member>
std::vector<Member> sorted(const std::vector<Outcome>& all, Member Outcome::*member) {
  std::vector<Member> values;
  for (const Outcome& one : all)
    if (one.accepted) values.push_back(one.*member);
  std::sort(values.begin(), values.end());
  return values;
}

template <class Value>
Value part(const std::vector<Value>& values, double share) {
  return values.at(static_cast<size_t>(share * static_cast<double>(values.size() - 1) + 0.5));
}

/// Prints a row: wrong answers, accepted results, error in lenses (median, 95 %, worst), answers
/// (median, 95 %, most) and key presses (median).
void print(const char* name, const std::vector<Outcome>& all) {
  const std::vector<double> errors = sorted(all, &Outcome::error_lenses);
  const std::vector<int> answers = sorted(all, &Outcome::answers);
  const std::vector<int> presses = sorted(all, &Outcome::presses);
  std::puts(fmt::format("| {} | {} of {} | {:.4f} | {:.4f} | {:.4f} | {} | {} | {} | {} |", name,
                        errors.size(), all.size(), part(errors, 0.5), part(errors, 0.95),
                        errors.back(), part(answers, 0.5), part(answers, 0.95), answers.back(),
                        part(presses, 0.5))
                .c_str());
}

long within(const std::vector<Outcome>& all, double lenses) {
  return std::count_if(all.begin(), all.end(), [&](const Outcome& one) {
    return one.accepted && one.error_lenses <= lenses;
  });
}

long silently_wrong(const std::vector<Outcome>& all) {
  return std::count_if(all.begin(), all.end(),
                       [](const Outcome& one) { return one.accepted && one.error_lenses > 0.05; });
}

TEST(QuestionsProperty, RightAnswersFindEverySheetWithFortyAnswers) {
  const std::vector<Outcome> all = outcomes({.wrong_share = 0.0}, 30'001);
  print("none", all);
  EXPECT_EQ(within(all, 0.02), kRuns);
  for (const Outcome& one : all) EXPECT_LE(one.answers, 40);
}

TEST(QuestionsProperty, ATenthOfWrongAnswersIsFoundAndAskedAgain) {
  const std::vector<Outcome> all = outcomes({.wrong_share = 0.1}, 30'002);
  print("10 %, any other band", all);
  EXPECT_GE(within(all, 0.02), kRuns * 95 / 100);
  EXPECT_EQ(silently_wrong(all), 0);
}

TEST(QuestionsProperty, ATenthOfNearlyRightAnswersIsFoundAndAskedAgain) {
  const std::vector<Outcome> all = outcomes({.wrong_share = 0.1, .nearly_right = true}, 30'003);
  print("10 %, two to four bands off", all);
  EXPECT_GE(within(all, 0.02), kRuns * 95 / 100);
  EXPECT_EQ(silently_wrong(all), 0);
}

TEST(QuestionsProperty, AFifthOfWrongAnswersIsNotAcceptedInSilence) {
  const std::vector<Outcome> all = outcomes({.wrong_share = 0.2}, 30'004);
  print("20 %, any other band", all);
  EXPECT_EQ(silently_wrong(all), 0);
}

}  // namespace
}  // namespace lenticule::calib::test
