// SPDX-License-Identifier: Apache-2.0
// Tests every fault of a driver, a link or another session while frames are shown.
#include <cerrno>

#include "kms_stage.h"

namespace lenticule::test {

class KmsFaults : public KmsStage {
 protected:
  /// Shows one frame after the fault to check that the display works again.
  void expect_playing(unsigned seed) {
    flip(seed);
    expect_displayed(seed);
  }
};

TEST_F(KmsFaults, LostFlipEventIsNoticedAndTheNextFlipWorks) {
  open();
  flip(1);
  card.event_faults = {EventFault::Lose};
  const Nanoseconds before = machine.now();
  flip(2);
  EXPECT_LT(machine.now() - before, milliseconds(400));
  expect_displayed(2);
  EXPECT_EQ(show->statistics().flip_timeouts, 1U);
  EXPECT_EQ(show->statistics().recoveries, 1U);
  EXPECT_EQ(show->statistics().modesets, 0U) << "a lost event is no reason to go dark";
  expect_playing(3);
}

TEST_F(KmsFaults, DuplicateFlipEventIsOneFlip) {
  open();
  card.event_faults = {EventFault::Duplicate};
  flip(1);
  EXPECT_EQ(wait(milliseconds(50)).kind, EventKind::Timeout);
  EXPECT_EQ(show->statistics().stray_events, 1U);
  expect_playing(2);
}

TEST_F(KmsFaults, LateFlipEventIsWaitedFor) {
  open();
  card.event_faults = {EventFault::Late};
  flip(1);
  EXPECT_EQ(show->statistics().flip_timeouts, 0U);
  expect_playing(2);
}

TEST_F(KmsFaults, FlipEventAfterItsTimeoutIsNotASecondFlip) {
  open();
  flip(1);
  card.event_delay = [] { return milliseconds(350); };
  flip(2);
  EXPECT_EQ(show->statistics().flip_timeouts, 1U);
  expect_displayed(2);
  card.event_delay = nullptr;
  idle(seconds(1));
  EXPECT_EQ(show->statistics().stray_events, 1U);
  expect_playing(3);
}

TEST_F(KmsFaults, StaleEventIdIsIgnored) {
  open();
  card.event_faults = {EventFault::Stale};
  flip(1);
  EXPECT_EQ(show->statistics().stray_events, 1U);
  expect_playing(2);
}

TEST_F(KmsFaults, GarbageInTheEventStreamIsCountedAndIgnored) {
  open();
  flip(1);
  for (const auto& [theirs, ours] : card.ends) (void)!write(ours, "garbage", 7);
  EXPECT_EQ(wait(milliseconds(50)).kind, EventKind::Timeout);
  EXPECT_EQ(show->statistics().truncated_reads, 1U);
  expect_playing(2);
}

TEST_F(KmsFaults, BusyFiveTimesIsRetried) {
  open();
  card.flip_faults = {{.count = 5, .error = EBUSY}};
  expect_playing(1);
  EXPECT_EQ(show->statistics().busy, 5U);
  EXPECT_EQ(show->statistics().modesets, 0U);
}

TEST_F(KmsFaults, BusyForASecondStillShowsTheFrame) {
  open();
  flip(1);
  const Nanoseconds until = machine.now() + seconds(1);
  card.flip_faults = {{.error = EBUSY, .until = until}};
  card.commit_faults = {{.error = EBUSY, .until = until}};
  expect_playing(2);
  EXPECT_GE(machine.now(), until);
  EXPECT_LT(machine.now() - until, seconds(2));
  expect_playing(3);
}

TEST_F(KmsFaults, BusyForeverDoesNotBlockThePlayer) {
  open();
  flip(1);
  card.flip_faults = {{.error = EBUSY, .until = Nanoseconds::max()}};
  card.commit_faults = {{.error = EBUSY, .until = Nanoseconds::max()}};
  EXPECT_EQ(submit(2), SubmitStatus::Accepted);
  for (int i = 0; i < 60; ++i) {
    const Nanoseconds before = machine.now();
    EXPECT_EQ(wait(seconds(1)).kind, EventKind::Timeout);
    EXPECT_EQ(machine.now() - before, seconds(1));
  }
  EXPECT_LT(show->statistics().busy, 100U) << "with pauses, not in a loop";
  show.reset();
}

TEST_F(KmsFaults, AccessDeniedForAWhilePausesAndResumes) {
  for (const int error : {EACCES, EPERM}) {
    open();
    flip(1);
    const Nanoseconds until = machine.now() + seconds(3);
    card.flip_faults = card.commit_faults =
        card.set_master_faults = {{.error = error, .until = until}};
    EXPECT_EQ(submit(2), SubmitStatus::Paused);
    idle(seconds(2));
    EXPECT_EQ(submit(2), SubmitStatus::Paused);
    idle(seconds(4));
    EXPECT_EQ(show->statistics().times_paused, 1U);
    EXPECT_EQ(show->statistics().modesets, 1U);
    expect_playing(3);
    show.reset();
  }
}

TEST_F(KmsFaults, LostMastershipPausesAndResumes) {
  open();
  const uint64_t before = flip(1).sequence;
  card.foreign_master = true;
  machine.at(machine.now() + seconds(3), [this] { card.foreign_master = false; });
  EXPECT_EQ(submit(2), SubmitStatus::Paused);
  EXPECT_EQ(submit(2), SubmitStatus::Paused);
  // Time passes, so that the player's clock advances.
  ASSERT_TRUE(show->request_vblank(before));
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Vblank);
  idle(seconds(6));
  EXPECT_EQ(show->statistics().times_paused, 1U);
  EXPECT_EQ(show->statistics().denied, 1U);
  EXPECT_GT(show->statistics().modesets, 0U) << "all state may have changed meanwhile";
  expect_playing(3);
}

TEST_F(KmsFaults, MastershipLostAfterASubmitKeepsTheFlip) {
  open();
  flip(1);
  card.event_faults = {EventFault::Lose};
  EXPECT_EQ(submit(2), SubmitStatus::Accepted);
  card.foreign_master = true;
  machine.at(machine.now() + seconds(2), [this] { card.foreign_master = false; });
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Timeout);
  const DisplayEvent event = wait(seconds(10));
  EXPECT_EQ(event.kind, EventKind::Flip);
  EXPECT_EQ(event.id, 2U);
  expect_displayed(2);
}

TEST_F(KmsFaults, RefusedFlipIsShownByAModeset) {
  for (const int error : {EINVAL, ENOENT, ENOSPC, ERANGE}) {
    open();
    flip(1);
    card.flip_faults = {{.error = error}};
    expect_playing(2);
    EXPECT_EQ(show->statistics().refused, 1U);
    EXPECT_EQ(show->statistics().modesets, 1U);
    show.reset();
  }
}

TEST_F(KmsFaults, UnpluggedCardIsLostAndComesBack) {
  open();
  flip(1);
  card.unplug();
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Lost);
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Lost);
  EXPECT_FALSE(show->request_vblank(0));
  EXPECT_THROW(show->reconnect(), Error);
  EXPECT_EQ(wait(seconds(1)).kind, EventKind::Lost);
  card.gone = false;
  show->reconnect();
  expect_playing(2);
}

TEST_F(KmsFaults, HangUpAfterASubmitIsLostAtOnce) {
  open();
  flip(1);
  EXPECT_EQ(submit(2), SubmitStatus::Accepted);
  card.pending.clear();
  card.unplug();
  const Nanoseconds before = machine.now();
  EXPECT_EQ(wait(seconds(10)).kind, EventKind::Lost);
  EXPECT_EQ(machine.now(), before);
  show.reset();
  EXPECT_EQ(machine.mappings_alive, 0);
}

TEST_F(KmsFaults, LostDisplayReleasesTheCardEvenIfItHoldsItsFrame) {
  options.exit = display::ExitPolicy::Hold;
  open();
  flip(1);
  card.flip_faults = {{.error = EIO}};
  EXPECT_EQ(submit(2), SubmitStatus::Lost);
  connector->connected = false;
  EXPECT_THROW(show->reconnect(), Error);
  EXPECT_EQ(card.master_fd, -1);
  EXPECT_EQ(card.buffers.size(), 0U);
  EXPECT_EQ(show->acquire(), nullptr);
  connector->connected = true;
  show->reconnect();
  expect_playing(2);
}

TEST_F(KmsFaults, DisplayCanBeReconnectedWithoutBeingLost) {
  open();
  flip(1);
  show->reconnect();
  expect_playing(2);
  EXPECT_EQ(card.rmfb_on_screen, 0);
  connector->connected = false;
  EXPECT_THROW(show->reconnect(), Error);
  EXPECT_EQ(wait().kind, EventKind::Lost);
}

TEST_F(KmsFaults, SequenceWrapsWithoutAGapBetweenFlipsAndRequestedVblanks) {
  const uint64_t now = static_cast<uint64_t>(machine.now() / card.period);
  card.sequence_base = (uint64_t{1} << 32) - 10 - now;
  open();
  uint64_t last = flip(1).sequence;
  for (unsigned seed = 2; seed < 20; ++seed) {
    ASSERT_TRUE(show->request_vblank(last));
    const DisplayEvent tick = wait(seconds(1));
    EXPECT_EQ(tick.kind, EventKind::Vblank);
    EXPECT_EQ(tick.sequence, last + 1);
    last = flip(seed).sequence;
    EXPECT_EQ(last, tick.sequence + 1);
  }
  EXPECT_GT(last, uint64_t{1} << 32);
  EXPECT_EQ(show->statistics().lost_ticks, 0U);
}

TEST_F(KmsFaults, SuspendCausesAModesetAndPlayingContinues) {
  open();
  flip(1);
  card.event_faults = {EventFault::Lose};  // sleep loses pending flips
  EXPECT_EQ(submit(2), SubmitStatus::Accepted);
  machine.sleep(std::chrono::hours(8));
  const DisplayEvent event = wait(seconds(5));
  EXPECT_EQ(event.kind, EventKind::Flip);
  EXPECT_EQ(event.id, 2U);
  expect_displayed(2);
  EXPECT_EQ(show->statistics().suspends, 1U);
  EXPECT_GE(show->statistics().modesets, 1U);
  expect_playing(3);
}

TEST_F(KmsFaults, TimestampsThatJumpAreCorrected) {
  open();
  DisplayEvent last = flip(1);
  unsigned seed = 2;
  for (const Nanoseconds shift :
       {Nanoseconds(seconds(-50)), Nanoseconds(seconds(3600)), Nanoseconds(-machine.now()),
        Nanoseconds(milliseconds(200)), Nanoseconds(milliseconds(-200)), Nanoseconds{0}}) {
    card.timestamp_shift = shift;
    for (int i = 0; i < 5; ++i) {
      const DisplayEvent event = flip(seed++);
      EXPECT_EQ(event.sequence, last.sequence + 1);
      EXPECT_GE(event.time, last.time);
      EXPECT_LE(event.time, machine.now());
      last = event;
    }
  }
  EXPECT_NEAR(static_cast<double>((machine.now() - last.time).count()), 0.0, 1e6);
}

TEST_F(KmsFaults, ClockThatJumpsAheadAfterASubmitLosesNothing) {
  // The process or its machine was stopped without a suspend event from the kernel.
  for (const bool counts : {true, false}) {
    card.counts_vblanks = counts;
    open();
    const uint64_t before = flip(1).sequence;
    EXPECT_EQ(submit(2), SubmitStatus::Accepted);
    machine.advance_to(machine.now() + std::chrono::hours(10));
    const DisplayEvent event = wait();
    EXPECT_EQ(event.kind, EventKind::Flip);
    EXPECT_GT(event.sequence, before);
    expect_displayed(2);
    const uint64_t after = flip(3).sequence;
    EXPECT_GE(after, before + 10 * 3600 * 59);
    EXPECT_EQ(flip(4).sequence, after + 1);
    show.reset();
  }
}

TEST_F(KmsFaults, ClockJumpOfTheDriverNeverTurnsTimeBack) {
  open();
  DisplayEvent last = flip(1);
  for (unsigned seed = 2; seed < 20; ++seed) {
    // The counter goes back or jumps ahead, as after a reset of the card.
    card.sequence_base = seed % 2 == 0 ? 0 : 5000;
    const DisplayEvent event = flip(seed);
    EXPECT_GT(event.sequence, last.sequence);
    EXPECT_GE(event.time, last.time);
    last = event;
  }
}

TEST_F(KmsFaults, LostVblankEventIsReplacedByATimer) {
  open();
  const DisplayEvent shown = flip(1);
  ASSERT_TRUE(show->request_vblank(shown.sequence));
  card.pending.clear();
  const DisplayEvent tick = wait(seconds(2));
  EXPECT_EQ(tick.kind, EventKind::Vblank);
  EXPECT_GT(tick.sequence, shown.sequence);
  EXPECT_EQ(show->statistics().lost_ticks, 1U);
}

}  // namespace lenticule::test
