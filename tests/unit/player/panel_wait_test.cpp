// SPDX-License-Identifier: Apache-2.0
// Tests waiting for the requested panel, and the picture on a wrong panel meanwhile, on fake cards
// in simulated time.
#include "player/session/panel_wait.h"

#include <gmock/gmock.h>

#include <functional>
#include <vector>

#include "base/unique_fd.h"
#include "display/test_card.h"
#include "player/session/panel_card.h"
#include "tests/support/error_matchers.h"
#include "tests/unit/kms/kms_stage.h"

namespace lenticule::player {
namespace {

using display::Nanoseconds;
using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

constexpr frames::FrameGeometry kOther{200, 120};

class PanelWaitTest : public test::KmsStage {
 protected:
  PanelWaitTest() { waiting.rig = "lobby.toml"; }

  PanelWait make() {
    waiting.kms = options;
    waiting.report = [this](const PanelWaiting& now) {
      ++rounds;
      panel_missing = now.panel_missing;
      card_shown = now.card_shown;
      reason = now.reason.what();
    };
    waiting.release_stored = [this] { ++release_stored; };
    return PanelWait(waiting);
  }

  Error failure() {
    PanelWait wait = make();
    return test::error_of([&] { show = wait.open(); });
  }

  /// Connects another panel with a mode of its own.
  void plug_other(const std::string& serial = "OTHER", frames::FrameGeometry size = kOther) {
    connector->connected = true;
    connector->modes = {test::make_mode(size.width, size.height, 60)};
    card.set_edid(
        connector->id,
        test::EdidMaker{
            .manufacturer = "DEL", .product = 0xa0b1, .serial_text = serial, .name = "U2720Q"}
            .bytes());
    machine.announce_hotplug();
  }
  void plug_own() {
    connector->connected = true;
    connector->modes = {test::make_mode(test::kWidth, test::kHeight, 60)};
    card.set_edid(connector->id, test::EdidMaker{.serial_text = "ONE"}.bytes());
    machine.announce_hotplug();
  }
  void unplug_panel() {
    connector->connected = false;
    machine.announce_hotplug();
  }
  void at(Nanoseconds after, std::function<void()> what) {
    machine.at(machine.now() + after, std::move(what));
  }
  void record_displayed(Nanoseconds after) {
    at(after, [this] { displayed.push_back(card.displayed(crtc)); });
  }

  /// Returns the pixels of the test card that the connected panel should show now.
  [[nodiscard]] std::vector<uint32_t> expected_card(frames::FrameGeometry size) const {
    const display::PanelSearch search = display::search_panel(options);
    const display::CardText text =
        wrong_panel_card(options.output, search, search.present.at(0), "lobby.toml");
    const frames::WovenFrame frame = draw_test_card(size, text);
    return test::words_of(frame);
  }

  PanelWaitOptions waiting;
  int rounds = 0;
  bool panel_missing = false;
  bool card_shown = false;
  std::string reason;
  int release_stored = 0;
  std::vector<std::vector<uint32_t>> displayed;
};

TEST_F(PanelWaitTest, OpensAPresentPanelAtOnce) {
  show = make().open();
  flip(1);
  expect_displayed(1);
  EXPECT_EQ(rounds, 0);
}

TEST_F(PanelWaitTest, WithoutWaitingAnotherPanelIsAnErrorThatListsPresentPanels) {
  plug_other();
  waiting.at_start = seconds(0);
  const Nanoseconds before = machine.now();
  test::expect_error(failure(), ErrorKind::Input,
                     "HDMI-A-1 on /dev/dri/card0: DEL 0xa0b1 serial OTHER");
  EXPECT_EQ(machine.now(), before);
  EXPECT_EQ(card.modesets, 0) << "nothing was shown on another owner's panel";
}

TEST_F(PanelWaitTest, WaitsForAPanelThatIsOffAtStart) {
  connector->connected = false;
  waiting.at_start = hours(24);
  const Nanoseconds comes = machine.now() + seconds(1000);
  machine.at(comes, [this] { connector->connected = true; });
  show = make().open();
  EXPECT_LT(machine.now() - comes, seconds(2));
  EXPECT_GT(rounds, 900);
  EXPECT_FALSE(card_shown) << "there was nothing to show it on";
  EXPECT_TRUE(panel_missing);
  flip(1);
  expect_displayed(1);
}

TEST_F(PanelWaitTest, WaitingEndsInAnErrorIfNoPanelComes) {
  connector->connected = false;
  waiting.at_start = seconds(30);
  const Nanoseconds before = machine.now();
  EXPECT_THAT(failure().what(), HasSubstr("no panel is connected"));
  EXPECT_EQ(machine.now() - before, seconds(30));
}

TEST_F(PanelWaitTest, ALateEdidShowsNoTestCardMeanwhile) {
  card.set_edid(connector->id, {});
  waiting.at_start = seconds(60);
  at(milliseconds(1500), [this] { plug_own(); });
  show = make().open();
  EXPECT_FALSE(card_shown);
  flip(1);
}

TEST_F(PanelWaitTest, TwoMatchingPanelsAreAnErrorOnACommandLine) {
  card.add_crtc();
  card.add_connector(DRM_MODE_CONNECTOR_HDMIA, 2, test::make_mode(test::kWidth, test::kHeight, 60),
                     test::EdidMaker{.serial_text = "TWO"}.bytes());
  options.output.identity = {};
  waiting.at_start = seconds(60);
  const Nanoseconds before = machine.now();
  EXPECT_THAT(failure().what(), HasSubstr("more than one panel fits"));
  EXPECT_THAT(failure().what(), Not(HasSubstr("\n"))) << "an error is one line";
  EXPECT_EQ(machine.now(), before);
}

TEST_F(PanelWaitTest, RetriesAGraphicsCardInUseUntilItIsFree) {
  card.foreign_master = true;
  at(seconds(5), [this] { card.foreign_master = false; });
  show = make().open();
  EXPECT_FALSE(panel_missing) << "the panel was there all the time";
  EXPECT_GE(release_stored, 5);
  flip(1);
}

TEST_F(PanelWaitTest, AnInterruptionEndsTheWaiting) {
  connector->connected = false;
  WakeFd interrupted;
  waiting.cancel_fd = interrupted.fd();
  at(seconds(7), [&] { interrupted.signal(); });
  EXPECT_THAT(failure().what(), HasSubstr("interrupted"));
}

TEST_F(PanelWaitTest, AWrongPanelShowsATestCardInItsOwnModeUntilTheRightOneComes) {
  plug_other();
  record_displayed(seconds(1));
  record_displayed(seconds(6));
  const auto expected = expected_card(kOther);
  at(seconds(20), [this] { unplug_panel(); });
  at(seconds(25), [this] { plug_own(); });
  show = make().open();
  ASSERT_EQ(displayed.size(), 2u);
  EXPECT_TRUE(displayed[0].empty()) << "a panel that wakes up gets its time";
  EXPECT_EQ(displayed[1], expected);
  flip(1);
  expect_displayed(1);
  EXPECT_EQ(card.rmfb_on_screen, 0);
  EXPECT_EQ(card.buffers.size(), 3u) << "the card's buffers are gone";
}

TEST_F(PanelWaitTest, TheTestCardFollowsPluggedPanels) {
  plug_other();
  at(seconds(10), [this] { unplug_panel(); });
  at(seconds(12), [this] { plug_other("THIRD", {321, 201}); });
  record_displayed(seconds(11) + milliseconds(900));
  record_displayed(seconds(19));
  std::vector<uint32_t> expected;
  at(seconds(18), [&] { expected = expected_card({321, 201}); });
  at(seconds(20), [this] { plug_own(); });
  show = make().open();
  ASSERT_EQ(displayed.size(), 2u);
  EXPECT_TRUE(displayed[0].empty());
  EXPECT_EQ(displayed[1], expected);
}

TEST_F(PanelWaitTest, TheTestCardGetsAModesetForAPanelWithOtherTimings) {
  plug_other();
  at(seconds(10), [this] {
    plug_other("THIRD");
    connector->modes = {test::make_mode(kOther.width, kOther.height, 50)};
  });
  std::vector<uint32_t> expected;
  int modesets = 0;
  at(seconds(9), [&] { modesets = card.modesets; });
  at(seconds(12), [&] { expected = expected_card(kOther); });
  record_displayed(seconds(15));
  at(seconds(16), [&] { modesets = card.modesets - modesets; });
  at(seconds(20), [this] { plug_own(); });
  show = make().open();
  EXPECT_EQ(displayed.at(0), expected);
  EXPECT_GE(modesets, 1);
}

TEST_F(PanelWaitTest, AStaticTestCardProbesThePanelRarely) {
  plug_other();
  int probes_before = 0;
  at(seconds(100), [&] { probes_before = card.full_probes; });
  int probes = 0;
  at(seconds(200), [&] { probes = card.full_probes - probes_before; });
  at(seconds(201), [this] { plug_own(); });
  show = make().open();
  EXPECT_LE(probes, 15);
  EXPECT_GT(probes, 0) << "news may be lost";
}

TEST_F(PanelWaitTest, APanelWithoutTheRigsModeShowsThatOnATestCard) {
  connector->modes = {test::make_mode(kOther.width, kOther.height, 60)};
  options.output.identity = {};
  record_displayed(seconds(6));
  at(seconds(10), [this] { plug_own(); });
  const auto expected = expected_card(kOther);
  show = make().open();
  EXPECT_EQ(displayed.at(0), expected);
  flip(1);
}

TEST_F(PanelWaitTest, GivingUpRemovesTheTestCard) {
  card.show_console(connector->id, crtc);
  plug_other();
  waiting.at_start = seconds(10);
  EXPECT_EQ(failure().kind(), ErrorKind::Input);
  EXPECT_TRUE(card_shown);
  EXPECT_EQ(card.master_fd, -1);
  EXPECT_TRUE(card.value(crtc, "ACTIVE") == 1) << "the console is back";
}

TEST_F(PanelWaitTest, WaitingContinuesIfTheTestCardCannotBeShown) {
  plug_other();
  card.foreign_master = true;
  at(seconds(20), [this] {
    card.foreign_master = false;
    plug_own();
  });
  show = make().open();
  EXPECT_FALSE(card_shown);
  flip(1);
}

class PanelReturn : public PanelWaitTest {
 protected:
  ReconnectResult lose_and_reconnect(PanelWait& wait) {
    int served = 0;
    const PlayReport report;
    const ReconnectResult result = wait.reconnect(
        *show, {.report = report, .time_left = time_left, .serve_source = [&] { ++served; }});
    EXPECT_LE(std::abs(served - rounds), 1);
    return result;
  }
  std::optional<std::chrono::nanoseconds> time_left;
};

TEST_F(PanelReturn, AGraphicsCardThatReturnsIsUsedAgain) {
  PanelWait wait = make();
  show = wait.open();
  flip(1);
  card.unplug();
  at(seconds(40), [this] { card.gone = false; });
  EXPECT_EQ(lose_and_reconnect(wait), ReconnectResult::Reconnected);
  EXPECT_GE(rounds, 39);
  flip(2);
  expect_displayed(2);
}

TEST_F(PanelReturn, AnotherPanelShowsATestCardAndTheRightOneContinues) {
  PanelWait wait = make();
  show = wait.open();
  flip(1);
  unplug_panel();
  idle(seconds(1));
  plug_other();
  idle(seconds(1));
  EXPECT_EQ(wait.refusal(), std::nullopt);
  ASSERT_EQ(this->wait().kind, test::EventKind::Lost);
  const auto expected = expected_card(kOther);
  record_displayed(seconds(5));
  at(seconds(10), [this] { unplug_panel(); });
  at(seconds(12), [this] { plug_own(); });
  EXPECT_EQ(lose_and_reconnect(wait), ReconnectResult::Reconnected);
  EXPECT_EQ(displayed.at(0), expected) << "never 3-D that was made for another panel";
  EXPECT_TRUE(card_shown || rounds > 0);
  flip(2);
  expect_displayed(2);
}

TEST_F(PanelReturn, IsGivenUpAfterItsTimeout) {
  waiting.after_loss = seconds(10);
  PanelWait wait = make();
  show = wait.open();
  card.unplug();
  const Nanoseconds before = machine.now();
  EXPECT_EQ(lose_and_reconnect(wait), ReconnectResult::GivenUp);
  EXPECT_EQ(machine.now() - before, seconds(10));
  ASSERT_TRUE(wait.refusal());
  EXPECT_THAT(wait.refusal()->what(), HasSubstr("no graphics card"));
}

TEST_F(PanelReturn, WaitingEndsWithThePlayingTime) {
  time_left = seconds(4);
  PanelWait wait = make();
  show = wait.open();
  card.unplug();
  EXPECT_EQ(lose_and_reconnect(wait), ReconnectResult::TimeOver);
}

TEST_F(PanelReturn, WaitingEndsWithAnInterruption) {
  WakeFd interrupted;
  waiting.cancel_fd = interrupted.fd();
  PanelWait wait = make();
  show = wait.open();
  card.unplug();
  at(seconds(4), [&] { interrupted.signal(); });
  EXPECT_EQ(lose_and_reconnect(wait), ReconnectResult::Stopped);
}

TEST_F(PanelReturn, RepeatedLossesShareOneTimeout) {
  waiting.after_loss = seconds(10);
  PanelWait wait = make();
  show = wait.open();
  int losses = 0;
  ReconnectResult result = ReconnectResult::Reconnected;
  for (; result == ReconnectResult::Reconnected && losses < 100; ++losses) {
    card.flip_faults = {{.error = EIO}};
    EXPECT_EQ(submit(1), test::SubmitStatus::Lost);
    result = lose_and_reconnect(wait);
  }
  EXPECT_EQ(result, ReconnectResult::GivenUp);
  EXPECT_LE(losses, 13) << "a pause lies between two";
}

TEST_F(PanelReturn, ALossAfterALongTimeHasTheFullTimeout) {
  waiting.after_loss = seconds(10);
  PanelWait wait = make();
  show = wait.open();
  for (int i = 0; i < 20; ++i) {
    idle(seconds(60));
    card.unplug();
    at(seconds(8), [this] { card.gone = false; });
    EXPECT_EQ(lose_and_reconnect(wait), ReconnectResult::Reconnected);
    rounds = 0;
  }
}

display::PanelInfo panel_on(const std::string& connector) {
  display::PanelInfo panel;
  panel.connector = connector;
  panel.connected = true;
  return panel;
}

display::PanelInfo panel_on(const std::string& connector, const display::EdidIdentity& identity) {
  display::PanelInfo panel = panel_on(connector);
  panel.identity = identity;
  return panel;
}

TEST(WrongPanelCard, NamesExpectedPanelPresentPanelAndRemedy) {
  const display::OutputRequest request{
      .identity = {.manufacturer = "LGD", .product = 0x1234, .serial = "42", .edid_sha256 = {}},
      .panel = {3840, 2160}};
  display::EdidIdentity dell;
  dell.manufacturer = "DEL";
  dell.product = 7;
  dell.name = "U27";
  display::PanelSearch search;
  search.present = {panel_on("DP-1", dell), panel_on("DP-2")};
  search.present[0].modes = {
      {.width = 1920, .height = 1080, .refresh = {60, 1}},
      {.width = 2560, .height = 1440, .refresh = {60, 1}, .preferred = true}};
  const display::CardText card =
      wrong_panel_card(request, search, search.present[0], "/etc/lenticule/lobby.toml");
  EXPECT_EQ(card.headline, "WRONG PANEL");
  ASSERT_EQ(card.rows.size(), 6u);
  EXPECT_EQ(card.rows[0].text, "3840x2160 pixels, LGD 0x1234 serial 42");
  EXPECT_EQ(card.rows[1].text, "no-panel");
  EXPECT_EQ(card.rows[2].text, "DP-1: DEL 0x0007 'U27', 2560x1440@60");
  EXPECT_EQ(card.rows[3].text, "DP-2: EDID absent");
  EXPECT_EQ(card.rows[4].text, "/etc/lenticule/lobby.toml");
  EXPECT_THAT(card.rows[5].text, HasSubstr("lenticule panels"));
}

TEST(WrongPanelCard, DistinguishesPanelsThatDifferOnlyInTheirChecksum) {
  display::OutputRequest request;
  request.identity.edid_sha256 = std::string(64, 'a');
  display::EdidIdentity twin;
  twin.sha256 = std::string(64, 'b');
  display::PanelSearch search;
  search.present = {panel_on("DP-1", twin)};
  const display::CardText card = wrong_panel_card(request, search, search.present[0], "rig");
  EXPECT_THAT(card.rows[0].text, HasSubstr("aaaaaaaaaaaa"));
  EXPECT_THAT(card.rows[2].text, HasSubstr("bbbbbbbbbbbb"));
}

TEST(WrongPanelCard, ListsThePanelsOfAWall) {
  display::OutputRequest request;
  request.parts = {
      {.name = "left", .connector = "DP-1", .place = {.geometry = {3840, 2160}}},
      {.name = "right",
       .identity = {.manufacturer = "LGD", .product = {}, .serial = {}, .edid_sha256 = {}},
       .place = {.geometry = {1920, 1080}}}};
  display::PanelSearch search;
  search.refusal = {ErrorKind::Device, "panel 'right': kms: no panel is connected",
                    "check its cable"};
  search.present = {panel_on("DP-1")};
  const display::CardText card = wrong_panel_card(request, search, search.present[0], "wall.toml");
  EXPECT_EQ(card.headline, "PANEL MISSING");
  EXPECT_EQ(card.rows[0].text, "left: DP-1, 3840x2160 pixels");
  EXPECT_EQ(card.rows[1].text, "right: 1920x1080 pixels, LGD");
  EXPECT_THAT(card.rows.back().text, HasSubstr("check its cable"));
}

TEST(WrongPanelCard, AnUnreadableEdidIsNotReportedAsAWrongPanel) {
  display::OutputRequest request;
  request.identity.serial = "42";
  display::PanelSearch search;
  search.present = {panel_on("DP-1")};
  search.present[0].edid_problem = display::EdidProblem::BadChecksum;
  const display::CardText card = wrong_panel_card(request, search, search.present[0], "rig");
  EXPECT_EQ(card.headline, "UNKNOWN PANEL");
}

}  // namespace
}  // namespace lenticule::player
