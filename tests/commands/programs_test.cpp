// SPDX-License-Identifier: Apache-2.0
// Tests that the programs of separate packages act as one command, and what each says when another
// is not installed.
#include <nlohmann/json.hpp>

#include "base/installation.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

/// A fixture with a copy of lenticule that has no other program beside it.
class LonePlayer : public CommandTest {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(path("usr/bin"));
    std::filesystem::copy_file(LENTICULE_PROGRAM, path("usr/bin/lenticule"));
  }

  [[nodiscard]] ProcessResult run_alone(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), path("usr/bin/lenticule"));
    return run_process(arguments);
  }

  [[nodiscard]] std::vector<std::string> play(const std::string& source) const {
    return {"play",      source,    "--rig",  source_file("scenes/rigs/tiny.toml"),
            "--display", "virtual", "--wait", "5"};
  }

  /// Writes a shell script as a helper program of the installation.
  void install_helper(const std::string& name, const std::string& script) const {
    const auto folder = (folder_ / "usr/bin" / kHelpersFromPrograms).lexically_normal();
    std::filesystem::create_directories(folder);
    std::ofstream(folder / name) << "#!/bin/sh\n" + script;
    std::filesystem::permissions(folder / name, std::filesystem::perms::owner_all);
  }
};

TEST_F(LonePlayer, ListsEveryCommand) {
  EXPECT_EQ(run_alone({"--version"}).out, run({"--version"}).out);
  EXPECT_EQ(run_alone({"--help"}).out, run({"--help"}).out);
  EXPECT_EQ(run_alone({}).err, run({}).err);
  EXPECT_EQ(run_alone({"rendr"}).err, run({"rendr"}).err);
  EXPECT_EQ(run_alone({"play", "--help"}).out, run({"play", "--help"}).out);
}

TEST_F(LonePlayer, NamesThePackageOfACommandThatIsNotInstalled) {
  for (const char* command : {"render", "weave", "eye", "compare", "convert", "calibrate", "depth",
                              "rig", "scene", "completion", "man"}) {
    const ProcessResult result = run_alone({command, "--help"});
    EXPECT_EQ(result.exit_code, 1) << command;
    EXPECT_EQ(result.err, std::string("lenticule: ") + command +
                              ": lenticule-tools is not installed\n"
                              "  install the package lenticule\n");
  }
  expect_end(run_alone({"bench", "list"}), 1, "install the package lenticule-bench");
}

TEST_F(LonePlayer, ReportsAMissingProgramAsJson) {
  const ProcessResult result = run_alone({"render", "builtin:demo", "--json"});
  EXPECT_EQ(result.exit_code, 1);
  const auto json = nlohmann::json::parse(result.err);
  EXPECT_EQ(json.at("error"), "render: lenticule-tools is not installed");
  EXPECT_EQ(json.at("hint"), "install the package lenticule");
  EXPECT_EQ(json.at("exit_code"), 1);
}

TEST_F(LonePlayer, NamesThePackageThatReadsPicturesAndVideos) {
  write("film.mkv", "not read");
  for (const std::string& source : {source_file("tests/data/crate.png"), path("film.mkv")}) {
    expect_end(run_alone(play(source)), 1, "install the package lenticule-media");
  }
}

// An upgrade replaces the decoders of a player that still runs.
TEST_F(LonePlayer, AsksForARestartWhenItsDecodersAreOfAnotherVersion) {
  write("film.mkv", "not read");
  install_helper("lenticule-video",
                 std::string("shift\nexec ") + LENTICULE_VIDEO_PROGRAM + " --for=0.0.1 \"$@\"\n");
  install_helper("lenticule-pictures",
                 std::string("exec ") + LENTICULE_PICTURES_PROGRAM + " $1 0.0.1 $3\n");
  for (const std::string& source : {source_file("tests/data/crate.png"), path("film.mkv")})
    expect_end(run_alone(play(source)), 1, "restart the player");
}

TEST_F(LonePlayer, ReportsWhyItsDecodersCannotStart) {
  write("film.mkv", "not read");
  install_helper("lenticule-video", "echo libavformat.so.61: not found >&2\nexit 127\n");
  expect_end(run_alone(play(path("film.mkv"))), 1, "libavformat.so.61: not found");
}

TEST_F(LonePlayer, TakesASampleRigOfItsInstallation) {
  const auto rigs = std::filesystem::path(path("usr")) / kDataFolder / "lenticule/rigs";
  const std::string rig = rigs / "tiny.toml";
  std::filesystem::create_directories(rigs);
  std::filesystem::copy_file(source_file("scenes/rigs/tiny.toml"), rig);
  expect_end(run_alone({"play", "card", "--clock", "simulated", "--duration", "0.1"}), 0,
             "no --rig: using the sample " + rig);
}

TEST_F(LonePlayer, PlaysASequenceWithoutDecoders) {
  const std::string rig = source_file("scenes/rigs/tiny.toml");
  ASSERT_EQ(run({"render", "builtin:demo", "--rig", rig, "--frames", "0:2", "-o", path("film.lts")})
                .exit_code,
            0);
  expect_end(run_alone(play(path("film.lts"))), 0);
  expect_end(run_alone({"play", path("film.lts"), "--clock", "simulated"}), 0, "virtual 48x32");
}

// The folders are those of an installation: /usr/bin/lenticule starts
// /usr/libexec/lenticule/lenticule-tools, or the same in the folder that CMake was given.
TEST_F(LonePlayer, FindsOtherProgramsInTheFolderForHelperPrograms) {
  install_helper("lenticule-tools", "printf '%s,' \"$@\"\nexit 5\n");
  const ProcessResult result = run_alone({"--json", "scene", "--", "a b", ""});
  EXPECT_EQ(result.exit_code, 5);
  EXPECT_EQ(result.out, "--json,scene,--,a b,,");
  EXPECT_TRUE(result.err.empty()) << result.err;
}

TEST(Programs, ThePlayerIsLinkedWithNoLibraryForRenderingCalibrationPicturesOrVideos) {
  const ProcessResult result = run_process({"/usr/bin/ldd", LENTICULE_PROGRAM});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("libdrm"), std::string::npos) << result.out;
  for (const char* library : {"embree", "tbb", "OpenImageIO", "assimp", "ceres", "turbojpeg",
                              "apriltag", "avformat", "avcodec", "avutil"})
    EXPECT_EQ(result.out.find(library), std::string::npos) << library;
}

TEST(Programs, ManualAndCompletionListTheFlagsOfEveryProgram) {
  const std::string manual = run({"man"}).out;
  for (const char* flag : {"wait\\-for\\-panel", "depth\\-budget"})
    EXPECT_NE(manual.find(flag), std::string::npos) << flag;
  for (const char* shell : {"bash", "zsh", "fish"}) {
    const std::string script = run({"completion", shell}).out;
    for (const char* flag : {"--wait-for-panel", "--depth-budget"})
      EXPECT_NE(script.find(flag), std::string::npos) << shell << ": " << flag;
  }
}

}  // namespace
}  // namespace lenticule::test
