// SPDX-License-Identifier: Apache-2.0
#include "player/session/play_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/error_matchers.h"
#include "tests/support/scratch_folder.h"

namespace lenticule::player {
namespace {

using std::chrono::seconds;

class PlayPlanTest : public testing::Test {
 protected:
  PlayFlags flags;
  void SetUp() override {
    flags.source = "ring:/nowhere";
    flags.rig = LENTICULE_SOURCE_DIR "/scenes/rigs/tiny.toml";
    flags.display = "kms";
  }
  [[nodiscard]] ErrorKind failure() const {
    return test::error_of([this] { (void)make_plan(flags, false); }).kind();
  }
};

TEST_F(PlayPlanTest, ACommandLineWaitsOnlyForALostPanel) {
  const PlayPlan plan = make_plan(flags, false);
  EXPECT_EQ(plan.panel_at_start, seconds(0));
  EXPECT_EQ(plan.panel_after_loss, seconds(10));
  EXPECT_EQ(plan.display.kms.exit, display::ExitPolicy::Restore);
}

TEST_F(PlayPlanTest, AServiceWaitsForeverForItsPanelAndHoldsItsLastFrame) {
  const PlayPlan plan = make_plan(flags, true);
  EXPECT_EQ(plan.panel_at_start, std::nullopt);
  EXPECT_EQ(plan.panel_after_loss, std::nullopt);
  EXPECT_EQ(plan.display.kms.exit, display::ExitPolicy::Hold);
}

TEST_F(PlayPlanTest, TheProofOfPlayIsOnForServicesUnlessAFlagSaysOtherwise) {
  EXPECT_TRUE(make_plan(flags, true).proof);
  EXPECT_FALSE(make_plan(flags, false).proof);
  flags.proof = "off";
  EXPECT_FALSE(make_plan(flags, true).proof);
  flags.proof = "journal";
  EXPECT_TRUE(make_plan(flags, false).proof);
  flags.display = "virtual";
  flags.clock = "simulated";
  EXPECT_EQ(failure(), ErrorKind::Usage);
}

TEST_F(PlayPlanTest, AnExplicitWaitAppliesAtStartAndAfterALoss) {
  flags.wait_for_panel = "7";
  const PlayPlan service = make_plan(flags, true);
  EXPECT_EQ(service.panel_at_start, seconds(7));
  EXPECT_EQ(service.panel_after_loss, seconds(7));
  flags.wait_for_panel = "forever";
  EXPECT_EQ(make_plan(flags, false).panel_at_start, std::nullopt);
  flags.wait_for_panel = "0";
  EXPECT_EQ(make_plan(flags, true).panel_after_loss, seconds(0));
  flags.wait_for_panel = "soon";
  EXPECT_EQ(failure(), ErrorKind::Usage);
}

TEST_F(PlayPlanTest, AHungDiskDoesNotEndAPlayerThatRepeatsOrIsControlled) {
  flags.source = "film.lts";
  EXPECT_EQ(make_plan(flags, false).playback.stall_timeout, seconds(60));
  flags.loop = "forever";
  EXPECT_EQ(make_plan(flags, false).playback.stall_timeout, std::nullopt);
  flags.loop.clear();
  flags.source = "list.toml";
  EXPECT_EQ(make_plan(flags, false).playback.stall_timeout, std::nullopt);
  flags.wait = "5";
  EXPECT_EQ(make_plan(flags, false).playback.stall_timeout, seconds(5));
}

TEST_F(PlayPlanTest, ATestCardLoopsForeverByDefault) {
  flags.source = "card";
  EXPECT_EQ(make_plan(flags, false).playback.loops, kForever);
  flags.loop = "2";
  EXPECT_EQ(make_plan(flags, false).playback.loops, 2u);
  flags.source = "picture.png";
  flags.loop.clear();
  EXPECT_EQ(make_plan(flags, false).playback.loops, 1u);
}

TEST_F(PlayPlanTest, ADurationThatIsOverStillHasOneVblank) {
  EXPECT_EQ(whole_vblanks(seconds(2), {60, 1}), 120u);
  EXPECT_EQ(whole_vblanks(seconds(0), {60, 1}), 1u);
  EXPECT_EQ(whole_vblanks(seconds(-3), {60, 1}), 1u);
  EXPECT_EQ(vblanks_of(std::nullopt, {60, 1}), std::nullopt);
}

TEST_F(PlayPlanTest, AnInvalidRateNamesItsFlag) {
  flags.fps = "0";
  const Error error = test::error_of([this] { (void)make_plan(flags, false); });
  EXPECT_THAT(error.what(), testing::StartsWith("--fps: "));
  EXPECT_EQ(error.kind(), ErrorKind::Usage);
}

TEST_F(PlayPlanTest, TheListInAFolderIsPlayedInsteadOfAllFiles) {
  const test::ScratchFolder scratch;
  const std::string folder = scratch.path().string() + "/";
  for (const char* name : {"a.lts", "b.lts"}) {
    std::ofstream(folder + name) << "film";
    std::filesystem::last_write_time(folder + name,
                                     std::filesystem::file_time_type::clock::now() - seconds(10));
  }
  flags.source = scratch.path().string();
  flags.content.reweave = true;
  const auto sources = [this] {
    const PlayPlan plan = make_plan(flags, false);
    std::vector<std::string> names;
    for (const PlaylistItem& item : read_playlist(plan.source, flags, plan).items) {
      EXPECT_TRUE(item.source.content.reweave) << item.source.text;
      names.push_back(item.source.text);
    }
    return names;
  };
  EXPECT_THAT(sources(), testing::ElementsAre(folder + "a.lts", folder + "b.lts"));
  std::ofstream(folder + "playlist.json") << R"([{"filename": "b.lts"}])";
  EXPECT_THAT(sources(), testing::ElementsAre(folder + "b.lts"));
}

TEST_F(PlayPlanTest, RefusesImpossibleKmsOptionsBeforeOpeningTheCard) {
  flags.record = "png:/nowhere";
  EXPECT_EQ(failure(), ErrorKind::Usage);
  flags.record.clear();
  flags.clock = "simulated";
  EXPECT_EQ(failure(), ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::player
