// SPDX-License-Identifier: Apache-2.0
#include "optics/wall/wall.h"

#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "optics/rig_file.h"
#include "tests/support/random_rigs.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::optics {
namespace {

constexpr const char* kTwo = R"(format = 1
viewer_mm = [10.0, 20.5, 900]
[[panel]]
name = "left"
rig = "rigs/left.toml"
centre_mm = [-310, 0, 0]
turn_degrees = 10.0
tilt_degrees = -5
roll_degrees = 0.25
[[panel]]
name = "right"
rig = "right.toml"
centre_mm = [310.0, 1.5, -2]
)";

std::string with(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

/// Returns the error for a text, remedy included; empty if the text is accepted.
std::string complaint(const std::string& text) {
  try {
    (void)parse_wall(text, "w.toml");
    return {};
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    return std::string(error.what()) + (error.hint().empty() ? "" : " | " + error.hint());
  }
}

TEST(WallFile, ReadsEveryKey) {
  const Wall wall = parse_wall(kTwo, "w.toml");
  EXPECT_EQ(wall.viewer_mm, (Vec3{10.0, 20.5, 900.0}));
  ASSERT_EQ(wall.panels.size(), 2U);
  EXPECT_EQ(wall.panels[0], (WallPanel{"left", "rigs/left.toml", {-310, 0, 0}, 10.0, -5.0, 0.25}));
  EXPECT_EQ(wall.panels[1], (WallPanel{"right", "right.toml", {310, 1.5, -2}, 0.0, 0.0, 0.0}));
}

TEST(WallFile, ReadsTheConnectorOfAPanel) {
  const std::string text =
      with(kTwo, "rig = \"right.toml\"", "rig = \"right.toml\"\noutput = \"DP-2\"");
  const Wall wall = parse_wall(text, "w.toml");
  EXPECT_EQ(wall.panels[0].output, "");
  EXPECT_EQ(wall.panels[1].output, "DP-2");
  EXPECT_EQ(complaint(with(text, "DP-2", "DP 2")),
            "w.toml:13: 'panel.output' is not the name of a connector | 'lenticule panels' lists "
            "them: output = \"DP-1\"");
}

TEST(WallFile, NamesAFilmPerPanel) {
  EXPECT_EQ(file_of_panel("film", "left"), "film-left.lts");
  EXPECT_EQ(file_of_panel("a.b/film.lts", "left"), "a.b/film-left.lts");
  EXPECT_EQ(file_of_panel("out/%05d.png", "right"), "out/%05d-right.png");
}

TEST(WallFile, NamesLineCauseAndRemedyOfErrors) {
  EXPECT_EQ(complaint(with(kTwo, "turn_degrees", "turned")),
            "w.toml:7: unknown key 'panel.turned' | known here: name, rig, output, centre_mm, "
            "turn_degrees, tilt_degrees, roll_degrees");
  EXPECT_EQ(complaint(with(kTwo, "roll_degrees", "rol_degrees")),
            "w.toml:9: unknown key 'panel.rol_degrees' | did you mean 'roll_degrees'?");
  EXPECT_EQ(complaint(with(kTwo, "\"right\"", "\"left\"")),
            "w.toml:11: two panels are named 'left'");
  EXPECT_EQ(complaint(with(kTwo, "\"right\"", "\"a/b\"")),
            "w.toml:11: 'panel.name' is not one to 32 letters, digits, '-' and '_' | it becomes a "
            "part of file names: name = \"left\"");
  EXPECT_EQ(complaint(with(kTwo, "turn_degrees = 10.0", "turn_degrees = 90")),
            "w.toml:7: 'panel.turn_degrees' is 90, not within -85 to 85");
  EXPECT_EQ(complaint(with(kTwo, "-310, 0, 0", "-310, 0")),
            "w.toml:6: 'panel.centre_mm' is not [x, y, z]");
  EXPECT_EQ(complaint(with(kTwo, "900]", "nan]")),
            "w.toml:2: 'viewer_mm' is nan, not within -1000000 to 1000000");
  EXPECT_EQ(complaint(with(kTwo, "rig = \"right.toml\"\n", "")),
            "w.toml:10: key 'panel.rig' is missing");
  EXPECT_EQ(complaint("format = 1\nviewer_mm = [0, 0, 1]\npanel = 3\n"),
            "w.toml:3: 'panel' is not a list of panels | each panel begins with [[panel]]");
  EXPECT_EQ(complaint(with(kTwo, "format = 1", "format = 2")),
            "w.toml:1: unknown format; expected 1 | it was made by a newer version of this "
            "program");
}

TEST(WallPanel, TurnsTiltsAndRollsAboutItsCentre) {
  const auto faces = [](const WallPanel& panel) { return wall_from_panel(panel).column_z; };
  EXPECT_GT(faces({.turn_degrees = 10.0}).x, 0.17);  // further right
  EXPECT_GT(faces({.tilt_degrees = 10.0}).y, 0.17);  // further up
  EXPECT_EQ(faces({.roll_degrees = 10.0}), (Vec3{0, 0, 1}));
  // A rolled panel has its right side up.
  EXPECT_GT(wall_from_panel({.roll_degrees = 10.0}).column_x.y, 0.17);
  const Affine map = wall_from_panel(
      {.centre_mm = {1, 2, 3}, .turn_degrees = 20.0, .tilt_degrees = -8.0, .roll_degrees = 2.0});
  EXPECT_EQ(map.point({0, 0, 0}), (Vec3{1, 2, 3}));
  EXPECT_NEAR(map.determinant(), 1.0, 1e-15);
  EXPECT_NEAR(length(map.vector({3, 4, 12})), 13.0, 1e-14);
  EXPECT_EQ(wall_from_panel({.centre_mm = {1, 2, 3}}).column_x, (Vec3{1, 0, 0}));
}

/// A folder with a wall of two panels.
class WallFolder : public testing::Test {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(folder_.path() / "rigs");
    save_rig(test::kiosk_rig(), folder_.path() / "rigs/left.toml");
    save_rig(test::kiosk_rig(), folder_.path() / "right.toml");
  }

  [[nodiscard]] PlacedWall load(const std::string& text) const {
    std::ofstream(folder_.path() / "wall.toml") << text;
    return load_wall(folder_.path() / "wall.toml");
  }

  test::ScratchFolder folder_;
};

TEST_F(WallFolder, GivesEachRigTheViewingLineThroughTheViewerOfTheWall) {
  const PlacedWall wall = load(kTwo);
  const ViewingLine& right = wall.panel("right").trimmed.rig.viewing;
  EXPECT_EQ(right.centre.value, -300.0);
  EXPECT_EQ(right.height.value, 19.0);
  EXPECT_EQ(right.distance.value, 902.0);
  for (const PlacedPanel& panel : wall.panels) {
    const ViewingLine& line = panel.trimmed.rig.viewing;
    const Vec3 viewer =
        panel.wall_from_panel.point({line.centre.value, line.height.value, line.distance.value});
    EXPECT_LT(length(viewer - wall.viewer_mm), 1e-9) << panel.name;
  }
}

TEST_F(WallFolder, KeepsTheTrimOfARigApart) {
  const std::string untrimmed = load(kTwo).panel("right").trimmed.identity.fingerprint;
  save_trim({.offset = Lenses(0.02)}, folder_.path() / "right.toml");
  const PlacedWall wall = load(kTwo);
  const PlacedPanel& panel = wall.panel("right");
  EXPECT_EQ(panel.trimmed.identity.calibration, untrimmed);
  EXPECT_EQ(panel.trimmed.identity.fingerprint, fingerprint(panel.trimmed.rig));
  EXPECT_EQ(panel.trimmed.rig.sheet.offset.value, 0.02);
  EXPECT_EQ(panel.calibrated.sheet.offset.value, 0.0);
}

TEST_F(WallFolder, RefusesAPanelThatFacesAwayFromTheViewer) {
  try {
    (void)load(with(kTwo, "310.0, 1.5, -2", "310.0, 1.5, 2000"));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("panel 'right': the viewer stands behind it"),
              std::string::npos)
        << error.what();
  }
}

TEST_F(WallFolder, NamesItsPanelsIfAPanelIsUnknown) {
  try {
    (void)load(kTwo).panel("middle");
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.hint(), "its panels are: left, right");
  }
}

}  // namespace
}  // namespace lenticule::optics
