// SPDX-License-Identifier: Apache-2.0
// Sequence containers on the command line: rendered, resumed, played, converted, refused.
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"

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

TEST_F(SequenceCommand, IsRenderedInTwoSittingsAndConvertedToTheSamePictures) {
  ASSERT_EQ(render("3:5", "film.lts").exit_code, 0);
  const ProcessResult second = render("3:7", "film.lts");
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_EQ(nlohmann::json::parse(second.out)["frames_skipped"], 2);
  ASSERT_EQ(render("3:7", "%02d.png").exit_code, 0);
  ASSERT_EQ(run({"convert", path("film.lts"), "-o", path("out%02d.png")}).exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(path("film.lts.part")));
  for (const std::string name : {"03.png", "04.png", "05.png", "06.png"})
    EXPECT_EQ(frames::read_woven(path(name)), frames::read_woven(path("out" + name))) << name;
}

TEST_F(SequenceCommand, IsPlayedAtItsRateAndCountsWhatIsDamaged) {
  ASSERT_EQ(render("0:4", "film.lts").exit_code, 0);
  {
    std::fstream file(path("film.lts"), std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(path("film.lts"))) - 300);
    file.put('x');
  }
  const ProcessResult played =
      run({"play", path("film.lts"), "--rig", kTiny, "--display", "virtual", "--clock", "simulated",
           "--loop", "2", "--slots", "2", "--json"});
  ASSERT_EQ(played.exit_code, 0) << played.err;
  const auto report = nlohmann::json::parse(played.out);
  EXPECT_EQ(report["shown"], 8);
  EXPECT_EQ(report["content_rate"], "24");
  EXPECT_EQ(report["damaged_frames"], 2);
}

TEST_F(SequenceCommand, RefusesAnotherRigNamingBoth) {
  ASSERT_EQ(render("0:2", "film.lts").exit_code, 0);
  const ProcessResult played =
      run({"play", path("film.lts"), "--rig", kOther, "--display", "virtual"});
  EXPECT_EQ(played.exit_code, 4);
  EXPECT_NE(played.err.find("'tiny'"), std::string::npos) << played.err;
  EXPECT_NE(played.err.find("'64 lenses"), std::string::npos) << played.err;
  EXPECT_EQ(render("0:4", "film.lts", kOther).exit_code, 4);
  EXPECT_TRUE(std::filesystem::exists(path("film.lts")));
}

TEST_F(SequenceCommand, ConvertKeepsTheRigAndRefusesAWrongOne) {
  ASSERT_EQ(render("0:3", "%02d.png").exit_code, 0);
  EXPECT_EQ(run({"convert", path("%02d.png"), "--rig", kOther, "-o", path("a.lts")}).exit_code, 4);
  const ProcessResult converted = run({"convert", path("%02d.png"), "--rig", kTiny, "--rate",
                                       "24000/1001", "--json", "-o", path("a.lts")});
  ASSERT_EQ(converted.exit_code, 0) << converted.err;
  EXPECT_EQ(nlohmann::json::parse(converted.out)["frames_converted"], 3);
  EXPECT_EQ(run({"convert", path("a.lts"), "--frames", "1:9", "-o", path("b.lts")}).exit_code, 4);
  ASSERT_EQ(run({"convert", path("a.lts"), "--frames", "1:3", "-o", path("b.lts")}).exit_code, 0);
  const ProcessResult played = run({"play", path("b.lts"), "--rig", kTiny, "--frames", "2:3",
                                    "--display", "virtual", "--clock", "simulated", "--json"});
  ASSERT_EQ(played.exit_code, 0) << played.err;
  EXPECT_EQ(nlohmann::json::parse(played.out)["shown"], 1);
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
