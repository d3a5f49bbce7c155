// SPDX-License-Identifier: Apache-2.0
// Tests `lenticule play card`: a test card on any display, also without a panel.
#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>

#include "frames/image_io.h"
#include "tests/commands/program.h"

namespace lenticule::test {
namespace {

class TestCardCommand : public CommandTest {
 protected:
  const std::string rig = source_file("scenes/rigs/kiosk-27-1080.toml");
};

TEST_F(TestCardCommand, IsShownOnAVirtualDisplayInThePanelsSize) {
  EXPECT_EQ(results_of(run({"play", "card", "--rig", rig, "--display", "virtual", "--loop", "1",
                            "--record", "png:" + path("shown"), "--json"}))
                .at("shown"),
            1);
  const frames::WovenFrame card = frames::read_woven(path("shown/00000000.png"));
  ASSERT_EQ(card.width(), 1920);
  ASSERT_EQ(card.height(), 1080);
  const auto is_white = [](uint8_t value) { return value == 255; };
  for (const int edge : {0, card.height() - 1})
    EXPECT_TRUE(std::all_of(card.row(edge), card.row(edge) + 3 * 1920, is_white));
  const auto bytes = card.bytes();
  const auto lit = std::count_if(bytes.begin(), bytes.end(), is_white);
  EXPECT_GT(lit, 100'000) << "words and patterns";
}

TEST_F(TestCardCommand, RecordingReportsTheNumberOfMissedFrames) {
  const ProcessResult played =
      run({"play", "card", "--rig", source_file("scenes/rigs/kiosk-27-4k.toml"), "--display",
           "virtual", "--fps", "60", "--loop", "40", "--record", "png:" + path("shown"), "--json"});
  ASSERT_EQ(played.exit_code, 0) << played.err;
  const nlohmann::json stats = nlohmann::json::parse(played.out);
  const uint64_t skipped = stats.at("recording").at("skipped");
  const auto recorded =
      static_cast<uint64_t>(std::distance(std::filesystem::directory_iterator(path("shown")), {}));
  EXPECT_EQ(recorded + skipped, 40u);
  EXPECT_EQ(played.err.find("are not recorded") != std::string::npos, skipped > 0) << played.err;
}

TEST_F(TestCardCommand, IsShownUntilInterrupted) {
  expect_end(run({"play", "card", "--rig", rig, "--display", "virtual"},
                 {.interrupt_signal = SIGINT, .interrupt_after = std::chrono::milliseconds(1500)}),
             130, "interrupted");
}

TEST_F(TestCardCommand, TimesOutIfTheNamedPanelIsMissing) {
  expect_end(run({"play", "card", "--rig", rig, "--display", "kms:HDMI-A-99", "--wait-for-panel",
                  "1", "--stats", path("stats.json")}),
             3, "waiting for the panel");
  const nlohmann::json stats = nlohmann::json::parse(std::ifstream(path("stats.json")));
  EXPECT_EQ(stats.at("outcome"), "waiting for the panel");
  EXPECT_EQ(stats.at("state"), "no-panel");
  EXPECT_NE(stats.at("reason"), "");
  EXPECT_EQ(stats.at("panel_missing"), true);
  EXPECT_EQ(stats.at("test_card_shown"), false);
}

}  // namespace
}  // namespace lenticule::test
