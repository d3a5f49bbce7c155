// SPDX-License-Identifier: Apache-2.0
// `lenticule calibrate by-eye` with scripted keys on a virtual display, and `lenticule rig trim`.
#include <cmath>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "optics/rig_file.h"
#include "optics/trim.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

using nlohmann::json;

class ByEyeCommand : public CommandTest {
 protected:
  void SetUp() override {
    rig_ = optics::load_rig(source_file("scenes/rigs/tiny.toml"));
    rig_.viewing.distance = Millimetres(500.0);
    optics::save_rig(rig_, path("rig.toml"));
  }
  [[nodiscard]] ProcessResult calibrate(const std::string& keys,
                                        std::vector<std::string> more = {}) const {
    write("keys.txt", keys);
    return run(joined({"calibrate", "by-eye", "--rig", path("rig.toml"), "--display", "virtual",
                       "-o", path("rig.toml"), "--keys", path("keys.txt"), "--json"},
                      more));
  }

  optics::Rig rig_;
};

/// Marks the middle band 39 times, which is enough answers; escape then restores the start's
/// values.
const std::string kToTheOffset = "enter # prepared\nenter*39 escape ";
const std::string kToTheEnd = kToTheOffset + "enter*6";

TEST_F(ByEyeCommand, SavesTheFoundValuesAndKeepsTheOldRig) {
  const ProcessResult result =
      calibrate(kToTheOffset + "enter # to the check\n]*2 up*3 shift+left enter*5\n");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json done = json::parse(result.out);
  EXPECT_EQ(done.at("saved"), true);
  const optics::Rig found = optics::load_rig(path("rig.toml"));
  EXPECT_EQ(optics::load_rig(path("rig.1.toml")), rig_);
  EXPECT_NEAR(found.sheet.pitch.value / rig_.sheet.pitch.value, std::pow(1 + 1e-4, 3), 1e-12);
  EXPECT_NEAR(found.sheet.offset.value - rig_.sheet.offset.value, -0.1, 1e-4)
      << "but for the height of the eye, of which slant and pitch change the part";
  EXPECT_GT(found.sheet.slant, rig_.sheet.slant);
  EXPECT_EQ(done.at("rig_fingerprint"), optics::fingerprint(found));
  EXPECT_NE(result.err.find("slant"), std::string::npos) << "the terminal says what to do";
  ASSERT_EQ(calibrate(kToTheEnd).exit_code, 0);
  EXPECT_EQ(optics::load_rig(path("rig.2.toml")), found);
}

TEST_F(ByEyeCommand, MergesTheTrimIntoTheRigAndClearsIt) {
  optics::save_trim({Lenses(0.125), 1e-4}, path("rig.toml"));
  const optics::Rig seen = optics::load_trimmed_rig(path("rig.toml"));
  ASSERT_EQ(calibrate(kToTheEnd).exit_code, 0);
  const optics::Rig found = optics::load_trimmed_rig(path("rig.toml"));
  EXPECT_NEAR(found.sheet.pitch.value, seen.sheet.pitch.value, 1e-12);
  EXPECT_NEAR(found.sheet.offset.value, seen.sheet.offset.value, 1e-12);
  EXPECT_TRUE(optics::load_trim(path("rig.toml")).empty());
}

TEST_F(ByEyeCommand, LeavesTheRigAloneUnlessItIsSaved) {
  const std::vector<std::string> before = {"keys.txt", "rig.toml"};
  EXPECT_EQ(results_of(calibrate("enter*4 up*5 q")).at("saved"), false);
  expect_end(calibrate("enter*4 up*5"), 1, "keys ended");
  expect_end(calibrate("enter\nentre"), 4, "keys.txt:2: unknown key 'entre'");
  EXPECT_EQ(listing(), before);
  EXPECT_EQ(optics::load_rig(path("rig.toml")), rig_);
}

TEST_F(ByEyeCommand, ShowsEveryChartOfItsSteps) {
  const json done = results_of(
      calibrate("enter*100", {"--record", "png:" + path("charts"), "--distance", "600"}));
  EXPECT_EQ(done.at("distance_mm"), 600.0);
  int charts = 0;
  for (const auto& chart : std::filesystem::directory_iterator(path("charts"))) {
    EXPECT_EQ(frames::read_woven(chart.path()).width(), rig_.panel.width_px);
    ++charts;
  }
  EXPECT_EQ(charts, done.at("questions").at("answers").get<int>() + 7)
      << "one per question and per other step";
}

TEST_F(ByEyeCommand, FailsWithoutStandardInput) {
  const std::string command = std::string(LENTICULE_PROGRAM) + " calibrate by-eye --rig " +
                              path("rig.toml") + " --display virtual -o " + path("new.toml") +
                              " 0<&-";
  expect_end(run_process({"/bin/sh", "-c", command}), 1, "keys ended");
}

TEST_F(ByEyeCommand, RefusesInvalidDistances) {
  EXPECT_EQ(calibrate("q", {"--distance", "-5"}).exit_code, 2);
  rig_.viewing.distance = Millimetres(std::numeric_limits<double>::infinity());
  optics::save_rig(rig_, path("rig.toml"));
  expect_end(calibrate("q"), 2, "--distance");
}

TEST_F(ByEyeCommand, AScriptNeedsInsistToSaveAnImplausibleGap) {
  // Moves to the zones, then enters 25 mm where the rig says 107 mm.
  const std::string keys = kToTheOffset + "enter*2 shift+left*8 left*2 enter*4";
  expect_end(calibrate(keys), 5, "6.00 mm of the start", "--insist");
  EXPECT_EQ(optics::load_rig(path("rig.toml")), rig_);
  expect_end(calibrate(keys, {"--insist"}), 0);
  EXPECT_GT(optics::load_rig(path("rig.toml")).sheet.gap.value, 20.0);
}

TEST_F(ByEyeCommand, ScriptsAnswerQuestions) {
  // The middle band is always right: the start is the sheet. The keys end at some question.
  const ProcessResult ended = calibrate("enter # prepared\nenter*4");
  expect_end(ended, 1, "mark the column");
  const json report = json::parse(ended.out);
  EXPECT_EQ(report.at("questions").at("answers"), 4);
  EXPECT_EQ(report.at("saved"), false);

  // The second ladder at a place is shifted by a few rungs: its middle is nearly right, too.
  const json done = results_of(calibrate("enter*100"));
  EXPECT_EQ(done.at("saved"), true);
  EXPECT_LT(done.at("questions").at("answers"), 60);
  EXPECT_NEAR(done.at("after").at("effective_pitch_subpx").get<double>() /
                  done.at("before").at("effective_pitch_subpx").get<double>(),
              1.0, 5e-3);
}

TEST_F(ByEyeCommand, TrimsAddUpAndAreReportedAndCanBeReset) {
  const auto trim = [this](std::vector<std::string> flags) {
    flags.insert(flags.begin(), {"rig", "trim", path("rig.toml"), "--json"});
    return run(flags);
  };
  ASSERT_EQ(trim({"--offset-by", "0.02"}).exit_code, 0);
  const ProcessResult twice = trim({"--offset-by", "0.02", "--pitch-by", "-1e-5"});
  EXPECT_NE(twice.err.find("films that were woven before do not follow the trim"),
            std::string::npos)
      << twice.err;
  EXPECT_EQ(json::parse(twice.out).at("offset_lenses"), 0.04);
  EXPECT_EQ(json::parse(twice.out).at("pitch_relative"), -1e-5);

  const json shown = json::parse(run({"rig", "show", path("rig.toml"), "--json"}).out);
  EXPECT_EQ(shown.at("fingerprint"), json::parse(twice.out).at("fingerprint"));
  EXPECT_EQ(shown.at("trim").at("fingerprint_without_trim"), optics::fingerprint(rig_));
  EXPECT_EQ(run({"rig", "check", path("rig.toml")}).exit_code, 0);

  const ProcessResult reset = trim({"--reset"});
  EXPECT_EQ(json::parse(reset.out).at("fingerprint"), optics::fingerprint(rig_));
  EXPECT_EQ(listing(), std::vector<std::string>{"rig.toml"});
  EXPECT_EQ(trim({"--offset-by", "3"}).exit_code, 4);
  EXPECT_EQ(trim({"--pitch-by", "nan"}).exit_code, 4);
}

TEST_F(ByEyeCommand, EveryCommandAppliesTheTrim) {
  frames::write_woven(
      frames::WovenFrame({.width = rig_.panel.width_px, .height = rig_.panel.height_px}).view(),
      path("black.png"));
  const auto fingerprint_of_eye = [this] {
    const ProcessResult seen = run({"eye", path("black.png"), "--rig", path("rig.toml"), "--eye",
                                    "0,0,500", "-o", path("seen.png"), "--json"});
    EXPECT_EQ(seen.exit_code, 0) << seen.err;
    return json::parse(seen.out).at("rig_fingerprint").get<std::string>();
  };
  EXPECT_EQ(fingerprint_of_eye(), optics::fingerprint(rig_));
  optics::save_trim({Lenses(0.1), 0.0}, path("rig.toml"));
  EXPECT_EQ(fingerprint_of_eye(), optics::fingerprint(optics::load_trimmed_rig(path("rig.toml"))));
  write("rig.trim.toml", "offset = 1");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"rig", "check", path("rig.toml")},
        {"rig", "show", path("rig.toml")},
        {"play", "card", "--rig", path("rig.toml"), "--display", "virtual"},
        {"weave", path("black.png"), "--grid", "1x1", "--rig", path("rig.toml"), "-o",
         path("w.png")}}) {
    expect_end(run(command), 4, "rig.trim.toml:1: unknown key 'offset'");
  }
}

TEST_F(ByEyeCommand, NumberedViewsArePlayedAndTrimmingNeedsATerminal) {
  expect_end(run({"play", "views", "--rig", path("rig.toml"), "--display", "virtual", "--loop", "1",
                  "--record", "png:" + path("shown"), "--json"}),
             0);
  EXPECT_EQ(frames::read_woven(path("shown/00000000.png")).width(), rig_.panel.width_px);
  expect_end(run({"play", "views", "--rig", path("rig.toml"), "--display", "virtual", "--loop", "1",
                  "--trim"}),
             2);
}

}  // namespace
}  // namespace lenticule::test
