// SPDX-License-Identifier: Apache-2.0
// Tests sequence containers on the command line: rendered, resumed, played, converted, refused.
#include <gmock/gmock.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::test {
namespace {

const std::string kTiny = source_file("scenes/rigs/tiny.toml");
const std::string kOther = source_file("scenes/rigs/paper-64.toml");

class SequenceCommand : public CommandTest {
 protected:
  ProcessResult render(const std::string& frames, const std::string& output,
                       const std::string& rig = kTiny) const {
    return run({"render", "builtin:demo", "--rig", rig, "--frames", frames, "--fps", "24",
                "--resume", "--json", "-o", path(output)});
  }
};

TEST_F(SequenceCommand, IsRenderedInTwoRunsAndConvertedToTheSamePictures) {
  ASSERT_EQ(render("3:5", "film.lts").exit_code, 0);
  EXPECT_EQ(results_of(render("3:7", "film.lts"))["frames_skipped"], 2);
  ASSERT_EQ(render("3:7", "%02d.png").exit_code, 0);
  ASSERT_EQ(run({"convert", path("film.lts"), "-o", path("out%02d.png")}).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(path("film.lts.part")));
  for (const std::string name : {"03.png", "04.png", "05.png", "06.png"})
    EXPECT_EQ(frames::read_woven(path(name)), frames::read_woven(path("out" + name))) << name;
}

TEST_F(SequenceCommand, IsPlayedAtItsRateAndCountsDamagedFrames) {
  ASSERT_EQ(render("0:4", "film.lts").exit_code, 0);
  {
    std::fstream file(path("film.lts"), std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(path("film.lts"))) - 300);
    file.put('x');
  }
  const auto report =
      results_of(run({"play", path("film.lts"), "--rig", kTiny, "--display", "virtual", "--clock",
                      "simulated", "--loop", "2", "--slots", "2", "--json"}));
  EXPECT_EQ(report["shown"], 8);
  EXPECT_EQ(report["content_rate"], "24");
  EXPECT_EQ(report["damaged_frames"], 2);
}

TEST_F(SequenceCommand, RefusesAnotherRigNamingBoth) {
  ASSERT_EQ(render("0:2", "film.lts").exit_code, 0);
  expect_end(run({"play", path("film.lts"), "--rig", kOther, "--display", "virtual"}), 4, "'tiny'",
             "'64 lenses");
  EXPECT_EQ(render("0:4", "film.lts", kOther).exit_code, 4);
  EXPECT_TRUE(std::filesystem::exists(path("film.lts")));
}

/// Makes a film, then a trim: older frames still play, with a warning that states the phase error.
TEST_F(SequenceCommand, PlaysAFilmThatWasWovenBeforeTheRigWasTrimmed) {
  std::filesystem::copy_file(kTiny, path("rig.toml"));
  const std::string rig = path("rig.toml");
  const std::vector<std::string> play = {"play",    path("film.lts"), "--rig",
                                         rig,       "--display",      "virtual",
                                         "--clock", "simulated",      "--json"};
  ASSERT_EQ(render("0:3", "film.lts", rig).exit_code, 0);
  const ProcessResult before = run(play);
  ASSERT_EQ(before.exit_code, 0) << before.err;
  EXPECT_EQ(before.err.find("trim"), std::string::npos) << before.err;

  ASSERT_EQ(run({"rig", "trim", rig, "--offset-by", "0.01"}).exit_code, 0);
  const ProcessResult after = run(play);
  ASSERT_EQ(after.exit_code, 0) << after.err;
  EXPECT_EQ(nlohmann::json::parse(after.out)["shown"], 3);
  EXPECT_NE(after.err.find("film.lts: woven before the rig was trimmed by +0.01 lens"),
            std::string::npos)
      << after.err;
  // The same film in a list: later rounds do not repeat the warning.
  write("list.toml", "format = 1\n[[item]]\nsource = \"film.lts\"\n");
  const ProcessResult list = run({"play", path("list.toml"), "--rig", rig, "--display", "virtual",
                                  "--clock", "simulated", "--loop", "3"});
  ASSERT_EQ(list.exit_code, 0) << list.err;
  const size_t first = list.err.find("before the rig was trimmed");
  EXPECT_NE(first, std::string::npos) << list.err;
  EXPECT_EQ(list.err.find("before the rig was trimmed", first + 1), std::string::npos) << list.err;

  // A film of the trimmed rig plays without a warning, and with one after the trim is reset.
  ASSERT_EQ(run({"render", "builtin:demo", "--rig", rig, "--frames", "0:3", "-o", path("film.lts")})
                .exit_code,
            0)
      << "another trim is no other rig";
  EXPECT_EQ(run(play).err.find("trim"), std::string::npos);
  ASSERT_EQ(run({"rig", "trim", rig, "--reset"}).exit_code, 0);
  expect_end(run(play), 0, "before the rig was trimmed by -0.01 lens");
  // A film of another rig is still refused.
  EXPECT_EQ(run({"play", path("film.lts"), "--rig", kOther, "--display", "virtual"}).exit_code, 4);
}

TEST_F(SequenceCommand, ARendererWithoutThePlayersTrimIsAccepted) {
  std::filesystem::copy_file(kTiny, path("trimmed.toml"));
  ASSERT_EQ(run({"rig", "trim", path("trimmed.toml"), "--offset-by", "0.02"}).exit_code, 0);
  BackgroundProcess player(program({"play", "ring:" + path("ring"), "--rig", path("trimmed.toml"),
                                    "--display", "virtual", "--json"}));
  expect_end(run({"render", "builtin:demo", "--rig", kTiny, "--frames", "0:5", "--ring-timeout",
                  "60", "-o", "ring:" + path("ring")}),
             0);
  const ProcessResult played = player.wait(std::chrono::seconds(60));
  expect_end(played, 0, "before the rig was trimmed by +0.02 lens");
  const auto warnings = nlohmann::json::parse(played.out).at("rig_warnings");
  EXPECT_EQ(warnings.size(), 1u) << played.out;
}

TEST_F(SequenceCommand, ALiveRendererAdaptsItsErrorToTheRate) {
  BackgroundProcess player(
      program({"play", "ring:" + path("ring"), "--rig", kTiny, "--display", "virtual", "--json"}));
  // Far slower than the tiny rig needs, so that the error falls from 2 to its limit.
  const ProcessResult rendered =
      run({"render", "builtin:teapot", "--rig", kTiny, "--frames", "0:24", "--method", "adaptive",
           "--adapt-error", "0.2", "--ring-timeout", "60", "-o", "ring:" + path("ring"), "--json"});
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  const auto adapted = nlohmann::json::parse(rendered.out).at("adapted_error");
  EXPECT_EQ(adapted.at("frames_per_s"), 0.2);
  EXPECT_EQ(adapted.at("most_error"), 2.0);
  EXPECT_EQ(adapted.at("least_error"), 0.5);
  EXPECT_EQ(adapted.at("last_error"), 0.5);
  EXPECT_NE(rendered.err.find("tolerated error: 0.50 to 2.00 code values"), std::string::npos)
      << rendered.err;
  EXPECT_EQ(results_of(player.wait(std::chrono::seconds(60))).at("shown"), 24);
}

TEST_F(SequenceCommand, AnotherFilmIsReplacedOnlyWithOverwrite) {
  const auto again = [&](const std::string& scene, const std::string& rig, const std::string& to,
                         std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"render", scene, "--rig", rig, "--frames", "0:2", "-o", path(to)});
    return run(more);
  };
  ASSERT_EQ(again("builtin:demo", kTiny, "film.lts").exit_code, 0);
  EXPECT_EQ(again("builtin:demo", kTiny, "film.lts").exit_code, 0) << "the same film";
  const std::string bytes = read_text(path("film.lts"));
  const auto unchanged = [&] { return read_text(path("film.lts")) == bytes; };
  expect_end(again("builtin:gears:1", kTiny, "film.lts"), 4,
             "made from builtin:demo, not from builtin:gears:1", "--overwrite");
  EXPECT_EQ(again("builtin:demo", kOther, "film.lts").exit_code, 4);
  EXPECT_TRUE(unchanged());
  EXPECT_EQ(again("builtin:gears:1", kTiny, "film.lts", {"--resume", "--overwrite"}).exit_code, 2);
  EXPECT_EQ(again("builtin:gears:1", kTiny, "film.lts", {"--overwrite"}).exit_code, 0);
  EXPECT_FALSE(unchanged());

  // An unfinished file protects the name as well, and so does a file that is not a film.
  std::filesystem::rename(path("film.lts"), path("begun.lts.part"));
  EXPECT_EQ(again("builtin:demo", kTiny, "begun.lts").exit_code, 4);
  write("notes.lts", "not a film");
  EXPECT_EQ(again("builtin:demo", kTiny, "notes.lts").exit_code, 4);
  EXPECT_EQ(run({"convert", path("notes.lts"), "-o", path("x.lts")}).exit_code, 4);
}

TEST_F(SequenceCommand, PicturesOfAnotherPanelAndVideosAreReplacedOnlyWithOverwrite) {
  ASSERT_EQ(render("0:2", "%02d.png").exit_code, 0);
  const auto again = [&](const std::string& rig, std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"render", "builtin:demo", "--rig", rig, "--frames", "0:2", "-o",
                               path("%02d.png")});
    return run(more);
  };
  EXPECT_EQ(again(kTiny).exit_code, 0);
  expect_end(again(kOther), 4, "00.png: exists already");
  EXPECT_EQ(again(kOther, {"--overwrite"}).exit_code, 0);
  write("01.png", "not a picture");
  EXPECT_EQ(again(kOther).exit_code, 4);
  ASSERT_EQ(again(kOther, {"--overwrite"}).exit_code, 0);

  const std::vector<std::string> convert = {"convert", path("%02d.png"), "-o", path("film.mkv")};
  ASSERT_EQ(run(convert).exit_code, 0);
  expect_end(run(convert), 4);
  std::vector<std::string> overwrite = convert;
  overwrite.emplace_back("--overwrite");
  EXPECT_EQ(run(overwrite).exit_code, 0);
}

TEST_F(SequenceCommand, KilledAtAnyMomentAndResumedTheFileHasTheBytesOfOneRun) {
  const auto arguments = [&](const std::string& to) {
    return program(
        {"render", "builtin:demo", "--rig", kTiny, "--frames", "0:40", "--resume", "-o", path(to)});
  };
  ASSERT_EQ(run_process(arguments("whole.lts")).exit_code, 0);
  for (int kills = 0; kills < 12; ++kills) {
    BackgroundProcess writer(arguments("film.lts"));
    usleep(static_cast<useconds_t>(50000 + 60000 * kills));
    writer.signal(SIGKILL);
    (void)writer.wait(std::chrono::seconds(60));
  }
  ASSERT_EQ(run_process(arguments("film.lts")).exit_code, 0);
  const auto bytes = [&](const std::string& name) { return read_text(path(name)); };
  EXPECT_TRUE(bytes("film.lts") == bytes("whole.lts"));
  EXPECT_EQ(listing(), (std::vector<std::string>{"film.lts", "whole.lts"}));
}

/// Covers every file that a renderer or encoder was writing when it was killed.
TEST_F(SequenceCommand, TheNextRunRemovesFilesOfKilledWriters) {
  const std::vector<std::string> pictures =
      program({"render", "builtin:demo", "--rig", kTiny, "--frames", "0:400", "-o",
               path("out/%03d.png"), "--overwrite"});
  const std::vector<std::string> video =
      program({"convert", path("film.lts"), "--overwrite", "-o", path("out/film.mkv")});
  ASSERT_EQ(render("0:30", "film.lts").exit_code, 0);
  std::filesystem::create_directory(path("out"));  // a renderer may be killed before it does that
  for (int kills = 0; kills < 12; ++kills) {
    BackgroundProcess writer(kills % 2 == 0 ? pictures : video);
    usleep(static_cast<useconds_t>(50000 + 60000 * kills));
    writer.signal(SIGKILL);
    (void)writer.wait(std::chrono::seconds(60));
  }
  // The encoder of a killed run may take a moment to notice the end of its input.
  size_t left = 1;
  for (int tries = 0; tries < 50 && left > 0; ++tries) {
    expect_end(run_process(video), 0);
    const std::vector<std::string> names = listing();
    left = static_cast<size_t>(std::count_if(names.begin(), names.end(), [](const auto& name) {
      return name.find(".lenticule") != std::string::npos;
    }));
  }
  EXPECT_EQ(left, 0u);
}

TEST_F(SequenceCommand, ConvertKeepsTheRigAndRefusesAWrongOne) {
  ASSERT_EQ(render("0:3", "%02d.png").exit_code, 0);
  EXPECT_EQ(run({"convert", path("%02d.png"), "--rig", kOther, "-o", path("a.lts")}).exit_code, 4);
  EXPECT_EQ(results_of(run({"convert", path("%02d.png"), "--rig", kTiny, "--rate", "24000/1001",
                            "--json", "-o", path("a.lts")}))["frames_converted"],
            3);
  EXPECT_EQ(run({"convert", path("a.lts"), "--frames", "1:9", "-o", path("b.lts")}).exit_code, 4);
  ASSERT_EQ(run({"convert", path("a.lts"), "--frames", "1:3", "-o", path("b.lts")}).exit_code, 0);
  EXPECT_EQ(
      results_of(run({"play", path("b.lts"), "--rig", kTiny, "--frames", "2:3", "--display",
                      "virtual", "--clock", "simulated", "--duration", "0.01", "--json"}))["shown"],
      1);
}

TEST_F(SequenceCommand, ConvertRefusesACutFilmUnlessItsFramesAreAskedFor) {
  ASSERT_EQ(render("0:3", "film.lts").exit_code, 0);
  const auto bytes = std::filesystem::file_size(path("film.lts"));
  constexpr uint64_t kIndexAndTrailer = 3 * 8 + 40;
  std::filesystem::resize_file(path("film.lts"), bytes - kIndexAndTrailer - 1);
  const auto convert = [&](std::vector<std::string> more) {
    std::vector<std::string> words{"convert", path("film.lts"), "--overwrite", "-o",
                                   path("out%02d.png")};
    words.insert(words.end(), more.begin(), more.end());
    return run(words);
  };
  expect_end(convert({}), 1, "1 are missing");
  expect_end(convert({"--frames", "0:2"}), 0);
  expect_end(convert({"--keep-damaged"}), 0);
}

TEST_F(SequenceCommand, ConvertStatesTheErrorsOfAllItsRuns) {
  ASSERT_EQ(render("0:2", "film.lts").exit_code, 0);
  const auto error_after = [&](const std::string& from, const std::string& to,
                               std::vector<std::string> flags) {
    flags.insert(flags.begin(), {"convert", path(from), "-o", path(to), "--json"});
    return results_of(run(flags))["max_error"];
  };
  EXPECT_EQ(error_after("film.lts", "small.lts", {"--max-error", "4"}), 4);
  EXPECT_LT(std::filesystem::file_size(path("small.lts")),
            std::filesystem::file_size(path("film.lts")));
  EXPECT_EQ(error_after("small.lts", "copy.lts", {}), 4) << "a copy is not nearer to the original";
  EXPECT_EQ(error_after("small.lts", "smaller.lts", {"--max-error", "2"}), 6);
  const ProcessResult replaced = run({"convert", path("small.lts"), "-o", path("copy.lts")});
  EXPECT_EQ(replaced.exit_code, 0) << replaced.err;
  expect_end(run({"convert", path("small.lts"), "-o", path("film.lts")}), 4, "off by at most 0");
  // Views that are copied keep the error, too.
  EXPECT_EQ(error_after("film.lts", "views.lts", {"--as", "quilt"}), 0);
  EXPECT_EQ(error_after("views.lts", "lossy.lts", {"--max-error", "1"}), 1);
  EXPECT_EQ(error_after("lossy.lts", "copied.lts", {}), 1);
  EXPECT_EQ(error_after("copied.lts", "worse.lts", {"--max-error", "2"}), 3);
  const ProcessResult refused =
      run({"convert", path("film.lts"), "-o", path("a%02d.png"), "--max-error", "1"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, ::testing::HasSubstr("--max-error"));
}

TEST_F(SequenceCommand, TheCodecIsMeasured) {
  ASSERT_EQ(render("0:1", "one.png").exit_code, 0);
  const ProcessResult bench =
      run({"bench", "codec", "--picture", path("one.png"), "--runs", "1", "--json"});
  ASSERT_EQ(bench.exit_code, 0) << bench.err;
  const auto codecs = nlohmann::json::parse(bench.out)["frames"][0]["codecs"];
  ASSERT_GE(codecs.size(), 8u);
  EXPECT_EQ(codecs[1]["codec"], "container");
  EXPECT_LT(codecs[1]["bytes"], codecs[0]["bytes"]);
}

}  // namespace
}  // namespace lenticule::test
