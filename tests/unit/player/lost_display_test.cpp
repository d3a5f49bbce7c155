// SPDX-License-Identifier: Apache-2.0
// Tests displays that are lost during playback and come back.
#include <gmock/gmock.h>

#include <cerrno>
#include <optional>

#include "panel_fixture.h"

namespace lenticule::player {
namespace {

using display::Nanoseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

class LostDisplayTest : public test::PanelFixture {
 protected:
  LostDisplayTest() {
    playing.reconnect = [this](const LostDisplay& lost) { return replug(lost); };
  }

  /// Reconnects the card after `away`.
  ReconnectResult replug(const LostDisplay& lost) {
    ++losses;
    time_left = lost.time_left;
    EXPECT_EQ(lost.report.outcome, "display lost");
    lost.serve_source();
    if (card.gone) {
      EXPECT_THROW(show->reconnect(), Error);
      EXPECT_EQ(show->acquire(), nullptr);
    }
    machine.advance_to(machine.now() + away);
    card.gone = false;
    if (meanwhile) meanwhile();
    show->reconnect();
    return ReconnectResult::Reconnected;
  }

  Nanoseconds away = seconds(3);
  std::function<void()> meanwhile;
  int losses = 0;
  std::optional<Nanoseconds> time_left;
};

TEST_F(LostDisplayTest, ContinuesAtTheSameFrameAfterTheCardReturns) {
  script.frames = 20;
  on_shown = [this](uint64_t id) {
    if (id == 9 && losses == 0) card.unplug();
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(losses, 1);
  // Three buffers: one is displayed, at most two filled ahead are lost with the card.
  EXPECT_THAT(ids(), ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14, 15, 16,
                                            17, 18, 19));
  EXPECT_EQ(result.report.display_returns, 1u);
  EXPECT_EQ(result.report.frames_lost, 1u);
  EXPECT_EQ(result.report.pace.shown, 19u);
  EXPECT_EQ(result.report.pace.dropped, 0u);
  EXPECT_EQ(result.report.pace.underruns, 0u);
}

TEST_F(LostDisplayTest, CountsTheTimeWithoutADisplayAsHeldVblanks) {
  script.frames = 20;
  on_shown = [this](uint64_t id) {
    if (id == 9 && losses == 0) card.unplug();
  };
  // The card's vblank count restarts, as after a reset.
  meanwhile = [this] {
    card.sequence_base = uint64_t{0} - static_cast<uint64_t>(machine.now() / card.period);
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_NEAR(static_cast<double>(result.report.pace.held), 3.0 * 59.9, 5.0);
  EXPECT_NEAR(result.report.refresh_measured_hz, 59.9, 0.5);
}

TEST_F(LostDisplayTest, ShowsAStillPictureAgainAlthoughTheSourceHasNoNewFrame) {
  script.frames = 1;
  script.can_rewind = false;
  playing.loops = kForever;
  playing.stall_timeout = seconds(20);
  on_shown = [this](uint64_t) {
    if (losses == 0) machine.at(machine.now() + seconds(1), [this] { card.unplug(); });
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::SourceStalled);
  EXPECT_EQ(losses, 1);
  EXPECT_THAT(ids(), ::testing::ElementsAre(0, 0));
  EXPECT_EQ(result.report.frames_shown_again, 1u);
  EXPECT_EQ(result.report.frames_lost, 0u);
}

TEST_F(LostDisplayTest, ShowsTheLastFrameForItsFullTimeAfterALoss) {
  script.frames = 2;
  playing.content = frames::Rate{1, 1};
  on_shown = [this](uint64_t id) {
    if (id == 1 && losses == 0)
      machine.at(machine.now() + milliseconds(100), [this] { card.unplug(); });
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_THAT(ids(), ::testing::ElementsAre(0, 1, 1));
}

TEST_F(LostDisplayTest, ALossBeforeTheFirstPictureDoesNotBlockForever) {
  script.ready_at = [this](uint64_t) {
    return machine.now() < seconds(101) ? seconds(101) : seconds(0);
  };
  machine.at(machine.now() + milliseconds(500), [this] { card.unplug(); });
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(losses, 1);
  EXPECT_THAT(ids(), ::testing::ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9));
}

TEST_F(LostDisplayTest, AFlipRefusedWithEnodevLosesOnlyFilledBuffers) {
  card.flip_faults = {{.error = ENODEV}};
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(losses, 1);
  // No frame was displayed yet: the frames before the newest are lost.
  EXPECT_EQ(result.report.frames_lost + result.report.pace.shown, 10u);
  EXPECT_EQ(ids().back(), 9u);
}

TEST_F(LostDisplayTest, ADifferentRefreshAfterTheReturnRestartsPacing) {
  script.frames = 40;
  playing.content = frames::Rate{30, 1};
  on_shown = [this](uint64_t id) {
    if (id == 9 && losses == 0) card.unplug();
  };
  meanwhile = [this] {
    connector->modes = {test::make_mode(test::kWidth, test::kHeight, 120)};
    card.period = Nanoseconds(1'000'000'000 / 120);
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_NEAR(result.report.refresh.hertz(), 120, 2);
  // 10 frames of 2 vblanks, then about 29 of 4.
  EXPECT_EQ(result.report.pace.missed, 0u);
  EXPECT_GE(result.report.pace.repeated_planned, 9u + 28u * 3u);
}

TEST_F(LostDisplayTest, RecoversFromThirtyLosses) {
  script.frames = 5;
  playing.loops = 100;
  on_shown = [this](uint64_t id) {
    if (id / 15 > static_cast<uint64_t>(losses) && losses < 30) card.unplug();
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(losses, 30);
  EXPECT_EQ(result.report.loops, 100u);
  EXPECT_EQ(result.report.pace.shown + result.report.frames_lost,
            500u + result.report.frames_shown_again);
  for (size_t i = 1; i < shown.size(); ++i) EXPECT_GE(shown[i].id, shown[i - 1].id);
  EXPECT_EQ(card.buffers.size(), 3u);
}

TEST_F(LostDisplayTest, TheRequestedDurationContinuesWhileTheDisplayIsAway) {
  script.frames = 10;
  playing.loops = kForever;
  playing.vblanks = 120;
  on_shown = [this](uint64_t id) {
    if (id == 60 && losses == 0) card.unplug();
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  ASSERT_TRUE(time_left);
  EXPECT_GT(*time_left, milliseconds(900));
  EXPECT_LT(*time_left, milliseconds(1100));
  EXPECT_EQ(result.report.pace.vblanks, 120u);
  EXPECT_EQ(ids().back(), 60u) << "the time was over when the card came back";
}

TEST_F(LostDisplayTest, GivingUpIsALostDisplayWithCompleteStatistics) {
  playing.reconnect = [this](const LostDisplay&) {
    EXPECT_THROW(show->reconnect(), Error);
    return ReconnectResult::GivenUp;
  };
  on_shown = [this](uint64_t id) {
    if (id == 4) card.unplug();
  };
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::DisplayLost);
  EXPECT_EQ(result.report.outcome, "display lost");
  EXPECT_EQ(result.report.display_returns, 0u);
  EXPECT_EQ(result.report.pace.shown, 5u);
}

TEST_F(LostDisplayTest, AnErrorInReconnectingReleasesEverything) {
  playing.reconnect = [this](const LostDisplay&) {
    show->reconnect();
    return ReconnectResult::Reconnected;
  };
  on_shown = [this](uint64_t id) {
    if (id == 4) card.unplug();
  };
  EXPECT_THROW((void)play_script(), Error);
}

TEST_F(LostDisplayTest, AnInterruptionWhileTheDisplayIsAwayEndsPlaying) {
  playing.reconnect = [](const LostDisplay&) { return ReconnectResult::Stopped; };
  on_shown = [this](uint64_t id) {
    if (id == 4) card.unplug();
  };
  EXPECT_EQ(play_script().outcome, PlayOutcome::Stopped);
}

}  // namespace
}  // namespace lenticule::player
