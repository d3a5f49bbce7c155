// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule rig mount`, and that a player sends a turned panel what its viewer sees.
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"
#include "tests/support/noise_frame.h"
#include "tests/support/rig_text.h"
#include "tests/support/turned_picture.h"

namespace lenticule::test {
namespace {

class RigMount : public CommandTest {
 protected:
  void SetUp() override { write("rig.toml", rig_toml({.slant = 0.5, .offset_lenses = 0.1})); }

  [[nodiscard]] ProcessResult mount(const std::string& mounting) const {
    return run({"rig", "mount", path("rig.toml"), mounting, "-o", path("hung.toml"), "--json"});
  }
};

TEST_F(RigMount, StatesThePanelAsTheViewerSeesIt) {
  expect_end(mount("90"), 0);
  const auto shown =
      nlohmann::json::parse(run({"rig", "show", path("hung.toml"), "--json"}).out).at("panel");
  EXPECT_EQ(shown.at("mounting"), "90");
  EXPECT_EQ(shown.at("width_px"), 32);
  EXPECT_EQ(shown.at("height_px"), 48);
  EXPECT_EQ(shown.at("sent_width_px"), 48);
  EXPECT_EQ(shown.at("layout"), "vrgb");
  EXPECT_EQ(run({"rig", "check", path("hung.toml")}).exit_code, 0);
}

TEST_F(RigMount, RefusesUnknownMountingsAndNamesTheKnownOnes) {
  expect_end(mount("upside down"), 4, "180");
  EXPECT_EQ(listing(), std::vector<std::string>{"rig.toml"});
}

TEST_F(RigMount, OfAPlayingPanelSendsThePictureThatItsViewerSees) {
  for (const char* mounting : kMountingNames) {
    ASSERT_EQ(mount(mounting).exit_code, 0) << mounting;
    const frames::WovenFrame sent = noise_frame(48, 32, 6);
    frames::write_woven(seen_of(sent, mounting).view(), path("frame.png"));
    expect_end(
        run({"play", path("frame.png"), "--rig", path("hung.toml"), "--display", "virtual",
             "--clock", "simulated", "--duration", "0.1", "--record", "png:" + path("shown")}),
        0);
    EXPECT_EQ(frames::read_woven(path("shown/00000000.png")), sent) << mounting;
    std::filesystem::remove_all(path("shown"));
  }
}

TEST_F(RigMount, IsRefusedByFormatsThatCannotStateIt) {
  ASSERT_EQ(mount("180").exit_code, 0);
  for (const char* format : {"lkg", "cubevi"}) {
    const ProcessResult result =
        run({"rig", "export", path("hung.toml"), "--format", format, "-o", path("exported.json")});
    EXPECT_NE(result.exit_code, 0) << format;
    EXPECT_NE(result.err.find("panel.mounting"), std::string::npos) << result.err;
  }
}

}  // namespace
}  // namespace lenticule::test
