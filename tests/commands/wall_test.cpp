// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule render --wall` and `lenticule rig wall`.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"

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
    CommandTest::SetUp();
    write("scene.obj", kScene);
    write("rig.toml", R"(format = 1
[panel]
width_px = 48
height_px = 32
pixel_width_mm = 0.5
pixel_height_mm = 0.5
[sheet]
pitch_subpx = 7.7
slant = 0.25
gap_mm = 6
[viewing]
distance_mm = 500
)");
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
    std::vector<std::string> arguments = {"render", path("scene.obj"), "--wall", path("wall.toml")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
};

TEST_F(WallCommand, RendersOneSequencePerPanel) {
  const ProcessResult result = render({"--frames", "0:2", "-o", path("film"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json panels = json::parse(result.out).at("panels");
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
  const ProcessResult result = run({"rig", "wall", path("wall.toml"), "--rigs", path("rigs"),
                                    "--svg", path("wall.svg"), "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json wall = json::parse(result.out);
  EXPECT_EQ(wall.at("gaps").size(), 1U);
  // 25 mm between the centres, less the width of a turned panel.
  EXPECT_NEAR(wall.at("gaps")[0].at("gap_mm"), 25.0 - 24.0 * std::cos(3.0 * 3.14159265 / 180.0),
              1e-6);
  EXPECT_TRUE(std::filesystem::exists(path("wall.svg")));
  const ProcessResult play = run({"play", path("film-left.lts"), "--rig", path("rigs/left.toml"),
                                  "--display", "virtual", "--loop", "1"});
  EXPECT_EQ(play.exit_code, 0) << play.err;
  const ProcessResult other = run({"play", path("film-left.lts"), "--rig", path("rigs/right.toml"),
                                   "--display", "virtual", "--loop", "1"});
  EXPECT_EQ(other.exit_code, 4) << other.err;
}

TEST_F(WallCommand, ExplainsWrongFlags) {
  EXPECT_EQ(run({"render", path("scene.obj"), "-o", path("a.png")}).exit_code, 2);
  EXPECT_EQ(render({"--rig", path("rig.toml"), "-o", path("a.png")}).exit_code, 2);
  const ProcessResult unknown = render({"--panel", "middle", "-o", path("a.png")});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_NE(unknown.err.find("left, right"), std::string::npos) << unknown.err;
  const ProcessResult ring = render({"-o", "ring:" + path("socket")});
  EXPECT_EQ(ring.exit_code, 2);
  EXPECT_NE(ring.err.find("--panel"), std::string::npos) << ring.err;
}

}  // namespace
}  // namespace lenticule::test
