// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule render --wall`, `lenticule play --wall` and `lenticule rig wall`.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/comes_true.h"
#include "tests/support/rig_text.h"

namespace lenticule::test {
namespace {

using nlohmann::json;

/// A tetrahedron in front of a plate, as wide as both panels of the wall.
constexpr const char* kScene = R"(v -4 -1 -0.2
v 4 -1 -0.2
v 4 1 -0.2
v -4 1 -0.2
v -0.8 -0.8 0.1
v 0.8 -0.8 0.1
v 0 0.8 0.1
f 1 2 3 4
f 5 6 7
)";

class WallCommand : public CommandTest {
 protected:
  void SetUp() override {
    write("scene.obj", kScene);
    write("rig.toml", rig_toml());
    write("wall.toml", R"(format = 1
viewer_mm = [0, 0, 500]
[[panel]]
name = "left"
rig = "rig.toml"
centre_mm = [-12.5, 0, 0]
turn_degrees = 3
[[panel]]
name = "right"
rig = "rig.toml"
centre_mm = [12.5, 0, 0]
turn_degrees = -3
)");
  }

  [[nodiscard]] ProcessResult render(std::vector<std::string> more) const {
    return run(joined({"render", path("scene.obj"), "--wall", path("wall.toml")}, more));
  }
};

TEST_F(WallCommand, RendersOneSequencePerPanel) {
  const json panels =
      results_of(render({"--frames", "0:2", "-o", path("film"), "--json"})).at("panels");
  ASSERT_EQ(panels.size(), 2U);
  for (const json& panel : panels) {
    const std::string name = panel.at("panel");
    EXPECT_EQ(panel.at("output"), path("film-" + name + ".lts"));
    EXPECT_EQ(panel.at("frames_rendered"), 2);
    EXPECT_EQ(panel.at("stage").at("mm_per_unit"), panels[0].at("stage").at("mm_per_unit"));
  }
  EXPECT_NE(panels[0].at("rig_fingerprint"), panels[1].at("rig_fingerprint"));
}

TEST_F(WallCommand, RendersOnePanelWithTheBytesThatTheWholeWallHas) {
  ASSERT_EQ(render({"-o", path("all.png")}).exit_code, 0);
  const ProcessResult one = render({"--panel", "right", "-o", path("one.png")});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_FALSE(std::filesystem::exists(path("one-left.png")));
  const frames::WovenFrame all_right = frames::read_woven(path("all-right.png"));
  EXPECT_TRUE(
      std::ranges::equal(all_right.bytes(), frames::read_woven(path("one-right.png")).bytes()));
  EXPECT_FALSE(
      std::ranges::equal(all_right.bytes(), frames::read_woven(path("all-left.png")).bytes()));
}

TEST_F(WallCommand, WritesTheRigsThatTheFilmsAreMadeFor) {
  ASSERT_EQ(render({"-o", path("film"), "--json"}).exit_code, 0);
  const json wall = results_of(run({"rig", "wall", path("wall.toml"), "--rigs", path("rigs"),
                                    "--svg", path("wall.svg"), "--json"}));
  EXPECT_EQ(wall.at("gaps").size(), 1U);
  // 25 mm between the centres, less the width of a turned panel.
  EXPECT_NEAR(wall.at("gaps")[0].at("gap_mm"), 25.0 - 24.0 * std::cos(3.0 * 3.14159265 / 180.0),
              1e-6);
  EXPECT_TRUE(std::filesystem::exists(path("wall.svg")));
  const ProcessResult play = run({"play", path("film-left.lts"), "--rig", path("rigs/left.toml"),
                                  "--display", "virtual", "--duration", "0.1"});
  EXPECT_EQ(play.exit_code, 0) << play.err;
  expect_end(run({"play", path("film-left.lts"), "--rig", path("rigs/right.toml"), "--display",
                  "virtual", "--duration", "0.1"}),
             4);
}

/// Returns the checksums of the frames that a recording lists, in order.
std::vector<std::string> checksums(const std::string& file) {
  std::vector<std::string> sums;
  std::ifstream lines(file);
  for (std::string line; std::getline(lines, line);)
    if (!line.starts_with('#')) sums.push_back(line.substr(line.rfind(' ') + 1));
  return sums;
}

class WallPlay : public WallCommand {
 protected:
  void SetUp() override {
    WallCommand::SetUp();
    ASSERT_EQ(render({"--frames", "0:3", "-o", path("film")}).exit_code, 0);
  }
  [[nodiscard]] ProcessResult play(const std::vector<std::string>& words) const {
    std::vector<std::string> arguments = joined({"play"}, words);
    for (const char* word : {"--display", "virtual", "--clock", "simulated"})
      arguments.emplace_back(word);
    return run(arguments);
  }
  [[nodiscard]] ProcessResult play_wall(const std::vector<std::string>& words) const {
    std::vector<std::string> arguments = words;
    arguments.insert(arguments.end(), {"--wall", path("wall.toml")});
    return play(arguments);
  }
  /// Returns the columns from `left` on of a picture, as wide as one panel.
  static frames::WovenFrame half(const frames::WovenFrame& whole, int left) {
    frames::WovenFrame part({.width = whole.width() / 2, .height = whole.height()});
    for (int j = 0; j < part.height(); ++j)
      std::copy_n(whole.row(j) + size_t{3} * static_cast<size_t>(left), part.geometry().row_bytes(),
                  part.row(j));
    return part;
  }
};

TEST_F(WallPlay, OnePlayerShowsTheFilmsOfAllPanels) {
  EXPECT_EQ(results_of(play_wall({path("film.lts"), "--loop", "2", "--record",
                                  "png:" + path("shown"), "--json"}))
                .at("shown"),
            6);
  ASSERT_EQ(run({"rig", "wall", path("wall.toml"), "--rigs", path("rigs")}).exit_code, 0);
  for (const std::string name : {"left", "right"}) {
    expect_end(play({path("film-" + name + ".lts"), "--rig", path("rigs/" + name + ".toml"),
                     "--record", "png:" + path(name)}),
               0);
    for (const int frame : {0, 1, 2, 3, 5}) {
      const std::string file = fmt::format("{:08}.png", frame);
      const std::string own = fmt::format("{:08}.png", frame % 3);
      const frames::WovenFrame shown = frames::read_woven(path("shown/" + file));
      EXPECT_EQ(half(shown, name == "left" ? 0 : 48), frames::read_woven(path(name + "/" + own)))
          << name << " " << frame;
    }
  }
}

TEST_F(WallPlay, ListsAndBlackFramesAreForAllPanels) {
  write("list.toml",
        "[[item]]\nsource = \"film.lts\"\n[[item]]\nsource = \"black\"\n"
        "duration_s = 1\n");
  expect_end(play_wall({path("list.toml"), "--loop", "1", "--record",
                        "checksums:" + path("sums.txt"), "--json"}),
             0);
  const std::vector<std::string> sums = checksums(path("sums.txt"));
  ASSERT_EQ(sums.size(), 4U);
  EXPECT_NE(sums[2], sums[3]);
}

TEST_F(WallPlay, FilmsThatDoNotBelongTogetherAreRefused) {
  ASSERT_EQ(render({"--panel", "right", "--frames", "0:2", "-o", path("short.lts")}).exit_code, 0);
  std::filesystem::rename(path("short-right.lts"), path("film-right.lts"));
  expect_end(play_wall({path("film.lts")}), 4, "film-left.lts has 3 frames, and ");
  std::filesystem::copy_file(path("film-left.lts"), path("film-right.lts"),
                             std::filesystem::copy_options::overwrite_existing);
  expect_end(play_wall({path("film.lts")}), 4, "film-right.lts: was woven for rig");
}

TEST_F(WallPlay, RefusesWhatNeedsOneRig) {
  for (const std::string source : {"views", "ring:socket", "film.mkv"}) {
    expect_end(play_wall({source}), 2, "cannot be played on a wall");
  }
  expect_end(play_wall({path("film.lts"), "--trim"}), 2, "--trim: needs one rig");
  EXPECT_EQ(play_wall({path("film.lts"), "--rig", path("rig.toml")}).exit_code, 2);
}

TEST_F(WallPlay, ASnapshotShowsOnePanelAndWhatAnEyeSeesOnIt) {
  ASSERT_EQ(render({"--frames", "0:1", "-o", path("%03d.png")}).exit_code, 0);
  const BackgroundProcess player(
      program({"play", path("%03d.png"), "--wall", path("wall.toml"), "--display", "virtual",
               "--loop", "forever", "--control", path("c.sock")}));
  const auto snapshot = [this](std::vector<std::string> words) {
    words.insert(words.begin(), {"ctl", "--socket", path("c.sock"), "snapshot"});
    return run(words);
  };
  ASSERT_TRUE(comes_true([&] {
    return snapshot({path("left.png"), "--panel", "left"}).exit_code == 0;
  }));
  for (const std::string name : {"left", "right"}) {
    EXPECT_EQ(snapshot({path(name + ".png"), "--panel", name}).exit_code, 0);
    EXPECT_TRUE(std::ranges::equal(frames::read_woven(path(name + ".png")).bytes(),
                                   frames::read_woven(path("000-" + name + ".png")).bytes()))
        << name;
  }
  EXPECT_EQ(snapshot({path("eye.png"), "--panel", "right", "--eye", "0,0,500"}).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(path("eye.png")));
  for (const std::vector<std::string>& wrong :
       {std::vector<std::string>{}, {"--panel", "middle"}}) {
    std::vector<std::string> words = wrong;
    words.insert(words.begin(), path("wrong.png"));
    expect_end(snapshot(words), 2, "left, right");
  }
}

TEST_F(WallCommand, ExplainsWrongFlags) {
  EXPECT_EQ(render({"--rig", path("rig.toml"), "-o", path("a.png")}).exit_code, 2);
  expect_end(render({"--panel", "middle", "-o", path("a.png")}), 2, "left, right");
  expect_end(render({"-o", "ring:" + path("socket")}), 2, "--panel");
}

}  // namespace
}  // namespace lenticule::test
