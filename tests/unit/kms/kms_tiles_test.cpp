// SPDX-License-Identifier: Apache-2.0
// Tests panels with two connectors: one commit flips both tiles.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "display/kms/device/edid.h"
#include "display/kms/inspect.h"
#include "kms_stage.h"

namespace lenticule::test {
namespace {

using ::testing::HasSubstr;

std::vector<uint8_t> blob_of(const std::string& text) {
  std::vector<uint8_t> bytes(text.begin(), text.end());
  bytes.push_back(0);
  return bytes;
}

TEST(Tile, IsReadFromTheTextOfTheKernel) {
  const auto tile = display::parse_tile(blob_of("7:1:2:1:1:0:2560:2880"));
  ASSERT_TRUE(tile);
  EXPECT_EQ(*tile, (display::Tile{.group = 7,
                                  .single_monitor = true,
                                  .columns = 2,
                                  .rows = 1,
                                  .column = 1,
                                  .row = 0,
                                  .width = 2560,
                                  .height = 2880}));
}

TEST(Tile, RejectsTextsThatNoPanelHas) {
  for (const char* text : {"", "7", "7:1:2:1:1:0:2560", "7:1:2:1:1:0:2560:2880:1",
                           "7:1:2:1:2:0:2560:2880", "7:1:2:1:0:1:2560:2880",
                           "7:1:0:1:0:0:2560:2880", "7:1:2:1:0:0:0:2880", "7:1:2:1:0:0:-1:2880",
                           "7:1:2:1:0:0:2560:4294967296", "7:1:65:1:0:0:64:64", "a:1:2:1:0:0:1:1"})
    EXPECT_FALSE(display::parse_tile(blob_of(text))) << text;
}

class KmsTiles : public KmsStage {
 protected:
  KmsTiles() {
    right_crtc = card.add_crtc();
    right = &card.add_connector(DRM_MODE_CONNECTOR_HDMIA, 2, make_mode(kWidth / 2, kHeight, 60),
                                EdidMaker{.serial_text = "ONE"}.bytes());
    connector->modes = right->modes;
    connector->possible_crtcs = right->possible_crtcs = 3;
    set_tile(*connector, 0);
    set_tile(*right, 1);
  }

  void set_tile(const FakeConnector& of, int column) {
    const std::string text = fmt::format("7:1:2:1:{}:0:{}:{}", column, kWidth / 2, kHeight);
    card.add_property(of.id, {.name = "TILE",
                              .flags = DRM_MODE_PROP_BLOB | DRM_MODE_PROP_IMMUTABLE,
                              .value = card.add_blob(blob_of(text))});
  }

  /// Returns the part of a frame that a tile shows.
  [[nodiscard]] static std::vector<uint32_t> half(unsigned seed, int column) {
    const std::vector<uint32_t> whole = words_of(make_frame(seed));
    std::vector<uint32_t> words;
    for (int row = 0; row < kHeight; ++row) {
      const auto begin = whole.begin() + row * kWidth + column * kWidth / 2;
      words.insert(words.end(), begin, begin + kWidth / 2);
    }
    return words;
  }
  void expect_both_show(unsigned seed) {
    EXPECT_EQ(card.displayed(crtc), half(seed, 0));
    EXPECT_EQ(card.displayed(right_crtc), half(seed, 1));
  }

  uint32_t right_crtc = 0;
  FakeConnector* right = nullptr;
};

TEST_F(KmsTiles, OneCommitFlipsBothTiles) {
  open();
  for (unsigned n = 1; n <= 5; ++n) {
    flip(n);
    expect_both_show(n);
  }
  EXPECT_EQ(card.flips, 5);
  EXPECT_EQ(show->statistics().flips, 5U);
  EXPECT_EQ(show->statistics().stray_events, 0U);
  EXPECT_EQ(show->mode().geometry, kPanel);
}

TEST_F(KmsTiles, AFlipIsReportedWhenEveryTileShowsItAndTheSkewIsMeasured) {
  card.crtc_shift[right_crtc] = milliseconds(3);
  open();
  flip(1);
  EXPECT_EQ(show->statistics().largest_skew, milliseconds(3));
  card.crtc_shift[right_crtc] = milliseconds(1);
  flip(2);
  EXPECT_EQ(show->statistics().largest_skew, milliseconds(3)) << "the largest of all flips";
}

TEST_F(KmsTiles, ALostEventOfOneTileIsReplacedByABlockingCommit) {
  open();
  flip(1);
  card.event_faults = {EventFault::None, EventFault::Lose};
  flip(2);
  expect_both_show(2);
  EXPECT_EQ(show->statistics().flip_timeouts, 1U);
  EXPECT_EQ(show->statistics().recoveries, 1U);
  flip(3);
}

TEST_F(KmsTiles, ADuplicateEventOfOneTileDoesNotReplaceThatOfTheOther) {
  open();
  card.crtc_shift[right_crtc] = milliseconds(3);
  card.event_faults = {EventFault::Duplicate};
  const DisplayEvent event = flip(1);
  EXPECT_EQ(show->statistics().stray_events, 1U);
  EXPECT_EQ(show->statistics().largest_skew, milliseconds(3));
  EXPECT_LT(event.time, machine.now()) << "the time of the first tile's vblank";
}

TEST_F(KmsTiles, TheNameOfEitherConnectorOpensThePanel) {
  for (const char* name : {"HDMI-A-1", "HDMI-A-2"}) {
    options.output.connector = name;
    open();
    flip(1);
    expect_both_show(1);
    EXPECT_THAT(show->mode().name, HasSubstr("HDMI-A-1 and HDMI-A-2"));
    show.reset();
  }
}

TEST_F(KmsTiles, EachTileGetsACrtcOfItsOwnIfTheConsoleIsCloned) {
  card.show_console(connector->id, crtc);
  card.object(right->id).find("CRTC_ID")->value = crtc;
  open();
  flip(1);
  expect_both_show(1);
  EXPECT_EQ(card.value(connector->id, "CRTC_ID"), crtc);
  EXPECT_EQ(card.value(right->id, "CRTC_ID"), right_crtc);
  show.reset();
  EXPECT_EQ(card.value(right->id, "CRTC_ID"), crtc) << "restored";
}

TEST_F(KmsTiles, APanelWithoutOneOfItsCablesIsWaitedFor) {
  right->connected = false;
  EXPECT_THAT(failure().what(), HasSubstr("the panel has 2 connectors, and 1 of them can be used"));
}

TEST_F(KmsTiles, TooFewCrtcsAreAnError) {
  connector->possible_crtcs = right->possible_crtcs = 1;
  EXPECT_THAT(failure().what(), HasSubstr("no CRTC"));
}

TEST_F(KmsTiles, AFrameOfOneTileIsRefused) {
  options.output.panel.width = kWidth * 2;
  EXPECT_EQ(failure().kind(), ErrorKind::Input);
}

TEST_F(KmsTiles, UnpluggingOneCableIsALostPanel) {
  open();
  flip(1);
  plug(*right, false);
  plug(*right, true);
  flip(2);
  expect_both_show(2);
}

TEST_F(KmsTiles, SwitchingOffSwitchesAllTilesOff) {
  open();
  flip(1);
  EXPECT_TRUE(show->set_power(false));
  EXPECT_EQ(card.value(crtc, "ACTIVE"), 0U);
  EXPECT_EQ(card.value(right_crtc, "ACTIVE"), 0U);
  EXPECT_TRUE(show->set_power(true));
  expect_both_show(1);
}

TEST_F(KmsTiles, TheNextPlayerTakesAllTilesOverWithoutAModeset) {
  options.output.panel = kPanel;
  options.previous = die_after(1);
  expect_both_show(1);
  open();
  EXPECT_TRUE(show->took_over());
  EXPECT_EQ(card.modesets, 0);
  EXPECT_EQ(card.buffers.size(), 3U);
  flip(2);
  expect_both_show(2);
  EXPECT_EQ(card.modesets, 0);
  EXPECT_EQ(show->statistics().stray_events, 0U);
}

TEST_F(KmsTiles, ThatLostACableAreNotTakenOverAndTheirBuffersAreFreed) {
  options.previous = die_after(1);
  right->connected = false;
  EXPECT_THAT(failure().what(), HasSubstr("2 connectors, and 1 of them"));
  EXPECT_TRUE(card.buffers.empty());
}

TEST_F(KmsTiles, ThatAnotherProgramSwitchedOffGetAModeset) {
  options.previous = die_after(1);
  card.object(right_crtc).find("ACTIVE")->value = 0;
  open();
  EXPECT_FALSE(show->took_over());
  flip(2);
  expect_both_show(2);
}

// --- doctor ---------------------------------------------------------------------------------

TEST_F(KmsTiles, DoctorListsTheGroupWithThePlaceOfEachConnector) {
  const auto groups = display::tile_groups(display::inspect_cards(machine.session()).panels);
  ASSERT_EQ(groups.size(), 1U);
  const display::TileGroup& group = groups[0];
  EXPECT_EQ(group.group, 7U);
  EXPECT_EQ(group.width, kWidth);
  EXPECT_EQ(group.height, kHeight);
  ASSERT_EQ(group.tiles.size(), 2U);
  EXPECT_EQ(group.tiles[0].connector, "HDMI-A-1");
  EXPECT_EQ(group.tiles[1].connector, "HDMI-A-2");
  EXPECT_EQ(group.tiles[1].column, 1);
  EXPECT_TRUE(group.complete());
}

TEST_F(KmsTiles, DoctorListsAMissingTile) {
  connector->connected = false;
  const auto groups = display::tile_groups(display::inspect_cards(machine.session()).panels);
  ASSERT_EQ(groups.size(), 1U);
  EXPECT_EQ(groups[0].tiles[0].connector, "");
  EXPECT_EQ(groups[0].tiles[1].connector, "HDMI-A-2");
  EXPECT_FALSE(groups[0].complete());
}

TEST_F(KmsTiles, DoctorTestsAllTilesInOneCommit) {
  for (const char* spec : {"auto", "HDMI-A-1", "HDMI-A-2"}) {
    card.tests = 0;
    const auto found =
        display::diagnose(machine.session(), display::parse_output(spec), machine.platform());
    ASSERT_EQ(found.size(), 1U) << spec;
    EXPECT_EQ(found[0].problem, "") << spec;
    EXPECT_TRUE(found[0].tested);
    EXPECT_EQ(found[0].connectors, (std::vector<std::string>{"HDMI-A-1", "HDMI-A-2"}));
    EXPECT_EQ(card.tests, 1) << spec;
  }
  EXPECT_EQ(card.modesets + card.blocking_commits, 0);
}

TEST_F(KmsTiles, DoctorSaysThatATileIsMissing) {
  right->connected = false;
  const auto found = display::diagnose(machine.session(), {}, machine.platform());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].problem, HasSubstr("2 connectors, and 1 of them"));
  EXPECT_THAT(found[0].remedy, HasSubstr("all of its cables"));
}

TEST_F(KmsTiles, DoctorTestsOtherPanelsOfTheCardOnTheirOwn) {
  card.add_connector(DRM_MODE_CONNECTOR_DisplayPort, 1, make_mode(kWidth, kHeight, 60),
                     EdidMaker{.serial_text = "TWO"}.bytes())
      .possible_crtcs = 3;
  const auto found = display::diagnose(machine.session(), {}, machine.platform());
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].connectors.size(), 2U);
  EXPECT_EQ(found[1].connectors, std::vector<std::string>{"DP-1"});
}

TEST_F(KmsTiles, ARefusedJointCommitNamesAllConnectors) {
  card.test_faults = {{.count = 100, .error = ENOSPC}};
  const Error error = failure();
  EXPECT_THAT(error.what(), HasSubstr("HDMI-A-1 and HDMI-A-2"));
  EXPECT_THAT(error.hint(), HasSubstr("bandwidth"));
}

}  // namespace
}  // namespace lenticule::test
