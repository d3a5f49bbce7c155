// SPDX-License-Identifier: Apache-2.0
// Tests walls whose panels are on one card: one commit flips all panels, if the driver can.
#include <gmock/gmock.h>

#include "display/kms/inspect.h"
#include "kms_stage.h"
#include "tests/support/error_matchers.h"

namespace lenticule::test {
namespace {

using ::testing::HasSubstr;

constexpr int kLeftWidth = 16;
constexpr int kRightWidth = 8, kRightHeight = 4;

/// A panel of 16 x 6 pixels beside one of 8 x 4 that hangs on its side, so that frames for it have
/// 4 x 8 pixels.
class KmsWall : public KmsStage {
 protected:
  KmsWall() {
    right_crtc = card.add_crtc();
    connector->modes = {make_mode(kLeftWidth, kHeight, 60)};
    right = &card.add_connector(DRM_MODE_CONNECTOR_DisplayPort, 1, right_mode(),
                                EdidMaker{.serial_text = "TWO"}.bytes());
    connector->possible_crtcs = right->possible_crtcs = 3;
    options.output.panel = kPanel;
    options.output.identity = {};
    options.output.parts = {
        part("left", "ONE", {kLeftWidth, kHeight}, {}, 0),
        part("right", "TWO", {kRightWidth, kRightHeight}, turned_right(), kLeftWidth)};
  }

  /// Returns a mode with the refresh rate of the left panel.
  static drmModeModeInfo right_mode() {
    drmModeModeInfo mode = make_mode(kLeftWidth, kHeight, 60);
    mode.hdisplay = kRightWidth;
    mode.vdisplay = kRightHeight;
    return mode;
  }
  static optics::Mounting turned_right() { return optics::mounting_named("90"); }
  static display::OutputPart part(const char* name, const char* serial,
                                  frames::FrameGeometry geometry, const optics::Mounting& mounting,
                                  int left_px) {
    return {.name = name,
            .identity = {.manufacturer = "LGD", .product = {}, .serial = serial, .edid_sha256 = {}},
            .place = {.geometry = geometry, .mounting = mounting, .left_px = left_px}};
  }

  /// Returns a picture whose every subpixel depends on seed and place.
  static frames::WovenFrame picture(unsigned seed, frames::FrameGeometry geometry) {
    frames::WovenFrame frame(geometry);
    unsigned value = seed * 91 + static_cast<unsigned>(geometry.width);
    for (uint8_t& byte : frame.bytes()) {
      byte = static_cast<uint8_t>(value >> 16);
      value = value * 1103515245U + 12345U;
    }
    return frame;
  }
  static frames::WovenFrame left_picture(unsigned seed) {
    return picture(seed, {kLeftWidth, kHeight});
  }
  static frames::WovenFrame right_picture(unsigned seed) {
    return picture(seed, {kRightHeight, kRightWidth});
  }
  /// Returns the words that the turned panel scans out for a picture.
  static std::vector<uint32_t> turned_words(const frames::WovenFrame& seen) {
    const optics::PixelGrid grid{seen.width(), seen.height()};
    const std::vector<uint32_t> upright = words_of(seen);
    std::vector<uint32_t> words;
    for (int row = 0; row < kRightHeight; ++row)
      for (int column = 0; column < kRightWidth; ++column) {
        const optics::PixelPlace at = turned_right().seen_place({column, row}, grid);
        words.push_back(upright[static_cast<size_t>(at.row * seen.width() + at.column)]);
      }
    return words;
  }

  [[nodiscard]] SubmitStatus submit_wall(unsigned seed) {
    display::ScanoutBuffer* const buffer = show->acquire();
    EXPECT_NE(buffer, nullptr);
    const frames::WovenFrame left = left_picture(seed), turned = right_picture(seed);
    const frames::FrameView parts[] = {left.view(), turned.view()};
    buffer->fill({.geometry = kPanel, .bytes = {}, .parts = parts});
    return show->submit(buffer, seed);
  }
  DisplayEvent flip_wall(unsigned seed) {
    EXPECT_EQ(submit_wall(seed), SubmitStatus::Accepted);
    const DisplayEvent event = wait(seconds(5));
    EXPECT_EQ(event.kind, EventKind::Flip);
    EXPECT_EQ(event.id, seed);
    return event;
  }
  void expect_both_show(unsigned seed) {
    EXPECT_EQ(card.displayed(crtc), words_of(left_picture(seed)));
    EXPECT_EQ(card.displayed(right_crtc), turned_words(right_picture(seed)));
  }

  uint32_t right_crtc = 0;
  FakeConnector* right = nullptr;
};

TEST_F(KmsWall, OneCommitFlipsAllPanelsEachWithItsOwnSizeAndMounting) {
  open();
  for (unsigned n = 1; n <= 5; ++n) {
    flip_wall(n);
    expect_both_show(n);
  }
  EXPECT_EQ(card.flips, 5);
  EXPECT_EQ(show->statistics().flips, 5U);
  EXPECT_EQ(show->statistics().stray_events, 0U);
  EXPECT_TRUE(show->statistics().one_commit);
  EXPECT_EQ(show->mode().geometry, kPanel);
  EXPECT_EQ(show->mode().panel, "left and right");
}

TEST_F(KmsWall, ADriverThatRefusesOneCommitGetsOnePerPanelAndTheDifferenceIsMeasured) {
  card.joint_flips = false;
  card.crtc_shift[right_crtc] = milliseconds(4);
  open();
  for (unsigned n = 1; n <= 5; ++n) {
    flip_wall(n);
    expect_both_show(n);
  }
  EXPECT_EQ(card.flips, 10);
  EXPECT_FALSE(show->statistics().one_commit);
  EXPECT_EQ(show->statistics().largest_skew, milliseconds(4));
  EXPECT_EQ(show->statistics().modesets, 0U);
  EXPECT_EQ(show->statistics().flip_timeouts, 0U);
}

TEST_F(KmsWall, ABusyPanelIsTriedAgainWithoutOneCommit) {
  card.joint_flips = false;
  open();
  flip_wall(1);
  card.flip_faults = {{.skip = 1, .count = 1, .error = EBUSY}};  // the second panel's commit
  flip_wall(2);
  expect_both_show(2);
  flip_wall(3);
  expect_both_show(3);
  EXPECT_EQ(show->statistics().modesets, 0U);
}

TEST_F(KmsWall, PanelsAreFoundByTheirIdentitiesWhateverTheirConnectors) {
  card.set_edid(connector->id, EdidMaker{.serial_text = "TWO"}.bytes());
  card.set_edid(right->id, EdidMaker{.serial_text = "ONE"}.bytes());
  std::swap(connector->modes, right->modes);
  open();
  flip_wall(1);
  const auto shown_at = [this](const FakeConnector& place) {
    return card.displayed(static_cast<uint32_t>(card.value(place.id, "CRTC_ID")));
  };
  EXPECT_EQ(shown_at(*right), words_of(left_picture(1)));
  EXPECT_EQ(shown_at(*connector), turned_words(right_picture(1)));
}

TEST_F(KmsWall, EqualPanelsNeedTheNamesOfTheirConnectors) {
  card.set_edid(right->id, EdidMaker{.serial_text = "ONE"}.bytes());
  options.output.parts[1].identity.serial = "ONE";
  const Error error = failure();
  EXPECT_THAT(error.what(), HasSubstr("panel 'left'"));
  EXPECT_THAT(error.hint(), HasSubstr("output = "));
  options.output.parts[0].connector = "HDMI-A-1";
  options.output.parts[1].connector = "DP-1";
  open();
  flip_wall(1);
  expect_both_show(1);
}

TEST_F(KmsWall, TwoPanelsOfTheWallAreNotOnOneConnector) {
  options.output.parts[1] = options.output.parts[0];
  EXPECT_THAT(failure().what(), HasSubstr("HDMI-A-1 is another panel of the wall"));
}

TEST_F(KmsWall, AMissingPanelIsNamed) {
  right->connected = false;
  EXPECT_THAT(failure().what(),
              HasSubstr("panel 'right': kms: none is the panel that the rig was made for"));
  const auto search = display::search_panel(options, nullptr);
  EXPECT_FALSE(search.found);
  EXPECT_TRUE(search.may_come);
}

TEST_F(KmsWall, APanelRunsAtARateThatItDoesNotPreferIfTheOtherHasNoOther) {
  connector->modes = {make_mode(kLeftWidth, kHeight, 75),
                      make_mode(kLeftWidth, kHeight, 60, false)};
  open();
  flip_wall(1);
  expect_both_show(1);
  EXPECT_NEAR(show->mode().refresh.hertz(), 60.0, 0.5);
}

TEST_F(KmsWall, PanelsWithoutACommonRateAreRefused) {
  right->modes = {make_mode(kRightWidth, kRightHeight, 50)};
  expect_error(failure(), ErrorKind::Input, "same refresh rate");
}

TEST_F(KmsWall, APanelWithoutTheModeIsAnError) {
  right->modes = {make_mode(kRightWidth * 2, kRightHeight, 60)};
  EXPECT_THAT(failure().what(), HasSubstr("DP-1"));
}

TEST_F(KmsWall, PanelsOnTwoCardsAreRefused) {
  right->connected = false;
  FakeCard& other = machine.add_card("/dev/dri/card1");
  other.add_crtc();
  other.add_connector(DRM_MODE_CONNECTOR_HDMIA, 1, right_mode(),
                      EdidMaker{.serial_text = "TWO"}.bytes());
  EXPECT_THAT(failure().what(), HasSubstr("another graphics card"));
}

TEST_F(KmsWall, AnExchangedPanelIsNoticed) {
  open();
  flip_wall(1);
  card.set_edid(right->id, EdidMaker{.serial_text = "OTHER"}.bytes());
  machine.announce_hotplug();
  idle(seconds(1));
  EXPECT_EQ(show->statistics().panel, display::PanelState::WrongPanel);
  EXPECT_EQ(card.value(right_crtc, "ACTIVE"), 0U) << "frames woven for another panel are not shown";
}

TEST_F(KmsWall, UnpluggingOnePanelAndPluggingItInSetsTheModeAgain) {
  open();
  flip_wall(1);
  plug(*right, false);
  plug(*right, true);
  flip_wall(2);
  expect_both_show(2);
}

TEST_F(KmsWall, TheNextPlayerTakesAllPanelsOverWithoutAModeset) {
  options.exit = display::ExitPolicy::Hold;
  options.previous = die_after(1);  // a frame of the whole size
  open();
  EXPECT_TRUE(show->took_over());
  EXPECT_EQ(card.modesets, 0);
  flip_wall(2);
  expect_both_show(2);
}

TEST_F(KmsWall, APictureOfTheWholeSizeFillsAllPanels) {
  open();
  flip(1);
  const std::vector<uint32_t> whole = words_of(make_frame(1));
  std::vector<uint32_t> left;
  for (int row = 0; row < kHeight; ++row)
    left.insert(left.end(), whole.begin() + row * kWidth,
                whole.begin() + row * kWidth + kLeftWidth);
  EXPECT_EQ(card.displayed(crtc), left);
}

}  // namespace
}  // namespace lenticule::test
