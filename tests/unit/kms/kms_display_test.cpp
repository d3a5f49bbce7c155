// SPDX-License-Identifier: Apache-2.0
// Tests a display without faults: exact pixels, one flip per vblank, everything restored.
#include "display/display_sink.h"
#include "kms_stage.h"
#include "tests/support/turned_picture.h"

namespace lenticule::test {

class KmsDisplay : public KmsStage {};

TEST_F(KmsDisplay, ShowsEverySubpixelUnchanged) {
  open();
  for (unsigned seed = 1; seed <= 20; ++seed) {
    flip(seed);
    expect_displayed(seed);
  }
  EXPECT_EQ(show->statistics().flips, 20U);
  EXPECT_EQ(show->statistics().stray_events, 0U);
}

TEST_F(KmsDisplay, SendsATurnedPanelWhatItsViewerSees) {
  for (const char* mounting : test::kMountingNames) {
    options.mounting = optics::mounting_named(mounting);
    open();
    const frames::WovenFrame sent = make_frame(7);
    const frames::WovenFrame seen = test::seen_of(sent, mounting);
    ASSERT_EQ(show->mode().geometry, seen.geometry()) << mounting;
    display::DisplaySink sink(*show);
    ASSERT_EQ(sink.show(seen.view(), seconds(5)), frames::ShowResult::Shown);
    EXPECT_EQ(card.displayed(crtc), words_of(sent)) << mounting;
    EXPECT_EQ(show->takeover_state().width, kWidth);
    show.reset();
  }
}

TEST_F(KmsDisplay, FirstPictureIsBlackNotOldMemory) {
  open();
  EXPECT_EQ(card.displayed(crtc), std::vector<uint32_t>(size_t{kWidth} * kHeight, 0));
}

TEST_F(KmsDisplay, CountsByTimeIfTheDriverDoesNotCount) {
  card.counts_vblanks = false;
  open();
  EXPECT_FALSE(show->mode().hardware_clock);
  const DisplayEvent first = flip(1);
  for (unsigned seed = 2; seed < 100; ++seed) {
    const DisplayEvent event = flip(seed);
    EXPECT_EQ(event.sequence, first.sequence + seed - 1);
    EXPECT_GE(machine.now(), event.time) << "before its tick";
  }
}

TEST_F(KmsDisplay, DetectsADriverThatClaimsACounterButHasNone) {
  open();
  EXPECT_TRUE(show->mode().hardware_clock);
  card.counts_vblanks = false;
  uint64_t last = flip(1).sequence;
  for (unsigned seed = 2; seed < 20; ++seed) {
    const uint64_t sequence = flip(seed).sequence;
    EXPECT_GT(sequence, last);
    last = sequence;
  }
  EXPECT_FALSE(show->mode().hardware_clock);
  EXPECT_FALSE(show->statistics().hardware_clock);
}

TEST_F(KmsDisplay, ReportsAVblankWithoutAFlip) {
  for (const bool counts : {true, false}) {
    card.counts_vblanks = counts;
    open();
    const DisplayEvent shown = flip(1);
    ASSERT_TRUE(show->request_vblank(shown.sequence + 3));
    const DisplayEvent tick = wait(seconds(1));
    EXPECT_EQ(tick.kind, EventKind::Vblank);
    EXPECT_EQ(tick.sequence, shown.sequence + 4);
    show.reset();
  }
}

TEST_F(KmsDisplay, AskingAgainForTheSameVblankIsOneEvent) {
  open();
  const DisplayEvent shown = flip(1);
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(show->request_vblank(shown.sequence + 3));
  EXPECT_EQ(card.pending.size(), 1U);
  EXPECT_EQ(wait(seconds(1)).sequence, shown.sequence + 4);
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Timeout);
  EXPECT_EQ(show->statistics().stray_events, 0U);
}

TEST_F(KmsDisplay, AllowsOneFlipAtATime) {
  open();
  EXPECT_EQ(submit(1), SubmitStatus::Accepted);
  EXPECT_EQ(submit(2), SubmitStatus::Busy);
  EXPECT_EQ(wait().id, 1U);
}

TEST_F(KmsDisplay, NeverHandsOutTheDisplayedBuffer) {
  open();
  flip(1);
  EXPECT_EQ(submit(2), SubmitStatus::Accepted);
  display::ScanoutBuffer* third = show->acquire();
  ASSERT_NE(third, nullptr);
  EXPECT_EQ(show->acquire(), nullptr) << "one displayed, one pending, one being filled";
  third->fill(make_frame(3).view());
  show->discard(third);
  EXPECT_EQ(wait().kind, EventKind::Flip);
  expect_displayed(2);
}

TEST_F(KmsDisplay, EndsAWaitWhenWokenOrLate) {
  open();
  EXPECT_EQ(wait(milliseconds(5)).kind, EventKind::Timeout);
  int pipe_ends[2];
  ASSERT_EQ(pipe(pipe_ends), 0);
  ASSERT_EQ(write(pipe_ends[1], "x", 1), 1);
  const Nanoseconds before = machine.now();
  EXPECT_EQ(show->wait_event(before + seconds(9), pipe_ends[0]).kind, EventKind::Timeout);
  EXPECT_EQ(machine.now(), before);
  close(pipe_ends[0]);
  close(pipe_ends[1]);
}

TEST_F(KmsDisplay, TakesOverARunningModeWithoutAModeset) {
  card.show_console(connector->id, crtc);
  open();
  EXPECT_TRUE(show->took_over());
  EXPECT_EQ(card.modesets, 0);
  flip(1);
  expect_displayed(1);
}

TEST_F(KmsDisplay, TestsBeforeItSetsAMode) {
  open();
  EXPECT_FALSE(show->took_over());
  EXPECT_GE(card.tests, 1);
  EXPECT_EQ(card.modesets, 1);
}

TEST_F(KmsDisplay, ClearsOverlaysFromItsCrtc) {
  const uint32_t overlay = card.add_overlay_plane(crtc);
  open();
  EXPECT_EQ(card.value(overlay, "FB_ID"), 0U);
  EXPECT_EQ(card.value(overlay, "CRTC_ID"), 0U);
}

TEST_F(KmsDisplay, RestoresThePreviousPictureAtTheEnd) {
  card.show_console(connector->id, crtc);
  const auto before = card.displayed(crtc);
  open();
  flip(1);
  show.reset();
  EXPECT_EQ(card.displayed(crtc), before);
  EXPECT_EQ(card.rmfb_on_screen, 0) << "a framebuffer was removed while it was shown";
}

TEST_F(KmsDisplay, SwitchesTheOutputOffIfAskedTo) {
  options.exit = display::ExitPolicy::Black;
  open();
  flip(1);
  show.reset();
  EXPECT_EQ(card.value(crtc, "ACTIVE"), 0U);
}

TEST_F(KmsDisplay, ReleasesEverythingAtTheEnd) {
  for (int i = 0; i < 50; ++i) {
    open();
    flip(1);
    show.reset();
    ASSERT_EQ(card.buffers.size(), 0U);
    ASSERT_EQ(card.framebuffers.size(), 0U);
    ASSERT_EQ(machine.mappings_alive, 0);
    ASSERT_EQ(card.master_fd, -1);
  }
}

TEST_F(KmsDisplay, RunsFor400DaysByTheDriversCountOrByTime) {
  constexpr Nanoseconds days = std::chrono::hours(24 * 400);
  for (const bool counts : {true, false}) {
    card.counts_vblanks = counts;
    open();
    const uint64_t first = flip(1).sequence;
    machine.advance_to(machine.now() + days);
    uint64_t last = flip(2).sequence;
    const double expected = static_cast<double>(days.count()) * 1e-9 * show->mode().refresh.hertz();
    EXPECT_NEAR(static_cast<double>(last - first), expected, expected * 0.01);
    for (unsigned seed = 3; seed < 50; ++seed) EXPECT_EQ(flip(seed).sequence, ++last);
    expect_displayed(49);
    show.reset();
  }
}

}  // namespace lenticule::test
