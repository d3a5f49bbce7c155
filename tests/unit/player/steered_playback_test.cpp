// SPDX-License-Identifier: Apache-2.0
// Tests the output's power, the speed and timed cuts in simulated time: every vblank of every case
// is the same on every run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/faulty_display.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using test::DisplayedFrame;
using test::EventFate;

constexpr frames::FrameGeometry kSmall{.width = 16, .height = 8};
constexpr uint64_t kAfterCut = 1000;  ///< number of the first frame after a cut

/// Calls the test whenever the display plans a vblank, before that vblank.
class VblankHook final : public test::VirtualFaults {
 public:
  std::function<void(uint64_t)> before_vblank;
  EventFate fate(uint64_t sequence) noexcept override {
    if (before_vblank) before_vblank(sequence);
    return EventFate::Deliver;
  }
  display::Nanoseconds event_delay(uint64_t) noexcept override { return display::Nanoseconds{0}; }
};

/// A source that jumps to frame kAfterCut when the test calls go().
class CutSource final : public test::PlainSource {
 public:
  explicit CutSource(std::optional<frames::Rate> rate) : rate_(rate) {}
  void go() {
    ++cut_;
    number_ = kAfterCut * cut_;
    pulled_after_cut_ = 0;
  }
  [[nodiscard]] frames::FrameGeometry geometry() const override { return kSmall; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return rate_; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (cut_ > 0 && pulled_after_cut_ == 20) return frames::PullStatus::End;
    pixels_ = test::numbered_frame(kSmall, number_);
    out = {.frame = pixels_.view(), .number = number_++, .token = 0};
    ++pulled_after_cut_;
    return frames::PullStatus::Ready;
  }
  [[nodiscard]] uint64_t cut() const override {
    const uint64_t read = cut_;
    if (after_cut_is_read) after_cut_is_read();
    return read;
  }
  std::function<void()> after_cut_is_read;

 private:
  std::optional<frames::Rate> rate_;
  frames::WovenFrame pixels_{kSmall};
  uint64_t number_ = 0;
  uint64_t cut_ = 0;
  uint64_t pulled_after_cut_ = 0;
};

class SteeredPlayback : public testing::Test {
 protected:
  std::shared_ptr<display::SimulatedClock> clock = std::make_shared<display::SimulatedClock>();
  std::shared_ptr<VblankHook> hook = std::make_shared<VblankHook>();
  std::shared_ptr<test::RememberingRecorder> recorder =
      std::make_shared<test::RememberingRecorder>();
  PlaybackControl control;
  PlaybackOptions options{.filling = Filling::InPresenter, .control = &control};

  PlayResult play_source(frames::FrameSource& source) {
    const auto display = test::open_virtual_display(
        {.geometry = kSmall, .refresh = {60, 1}, .clock = clock, .recorder = recorder}, hook);
    PlayResult result = play(*display, source, options);
    const PaceCounts& pace = result.report.pace;
    EXPECT_EQ(pace.vblanks, pace.shown + pace.repeated_planned + pace.repeated_underrun +
                                pace.missed + pace.held);
    return result;
  }
  PlayResult play_frames(uint64_t frames, std::optional<frames::Rate> rate = std::nullopt) {
    test::FakeSource source({.geometry = kSmall, .frames = frames, .rate = rate, .clock = clock});
    return play_source(source);
  }
  /// Returns the vblank at which the first frame after a cut was displayed; 0 if none was.
  [[nodiscard]] uint64_t cut_shown_at() const {
    const uint64_t first = test::checksum_of(test::numbered_frame(kSmall, kAfterCut).view());
    for (const DisplayedFrame& frame : recorder->shown())
      if (frame.checksum == first) return frame.sequence;
    return 0;
  }
};

TEST_F(SteeredPlayback, AnOutputThatIsOffHoldsTheContentAndMissesNothing) {
  hook->before_vblank = [this](uint64_t sequence) {
    if (sequence == 20) (void)control.switch_output(false, milliseconds(0));
    if (sequence == 80) (void)control.switch_output(true, milliseconds(0));
  };
  const PlayResult result = play_frames(60);
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  const std::vector<DisplayedFrame> shown = recorder->shown();
  ASSERT_EQ(shown.size(), 60u);
  for (size_t k = 0; k < shown.size(); ++k) EXPECT_EQ(shown[k].id, k);
  for (const DisplayedFrame& frame : shown)
    EXPECT_TRUE(frame.sequence <= 20 || frame.sequence >= 80) << frame.sequence;
  EXPECT_EQ(result.report.pace.missed, 0u);
  EXPECT_EQ(result.report.pace.underruns, 0u);
  EXPECT_GE(result.report.pace.held, 58u);
  EXPECT_LE(result.report.pace.held, 61u);
  EXPECT_FALSE(result.report.off);
}

/// A jump is answered, and playback resumed, just when the player has read for the n-th time which
/// frames are of before a jump.
class JumpWhileHeld : public SteeredPlayback,
                      public testing::WithParamInterface<std::tuple<bool, int>> {};

TEST_P(JumpWhileHeld, FramesOfBeforeTheJumpAreNotShownWhenPlaybackResumes) {
  const auto [by_power, wanted] = GetParam();
  const auto hold = [&, by_power = by_power](bool held) {
    if (by_power)
      (void)control.switch_output(!held, milliseconds(0));
    else
      control.pause(held);
  };
  CutSource source(std::nullopt);
  hook->before_vblank = [&](uint64_t sequence) {
    if (sequence == 20) hold(true);
  };
  size_t shown_before = 0;
  int read = 0;
  source.after_cut_is_read = [&, wanted = wanted] {
    const bool is_held = clock->now() > milliseconds(500);
    if (!is_held || ++read != wanted) return;
    source.go();
    hold(false);
    shown_before = recorder->shown().size();
  };
  EXPECT_EQ(play_source(source).outcome, PlayOutcome::Finished);
  const std::vector<DisplayedFrame> shown = recorder->shown();
  ASSERT_GT(shown_before, 0U);
  ASSERT_GT(shown.size(), shown_before);
  EXPECT_EQ(shown[shown_before].sequence, cut_shown_at());
}
INSTANTIATE_TEST_SUITE_P(Moments, JumpWhileHeld,
                         testing::Combine(testing::Bool(), testing::Range(1, 7)));

TEST_F(SteeredPlayback, TheFirstFrameIsShownBeforeTheOutputIsSwitchedOff) {
  (void)control.switch_output(false, milliseconds(0));
  options.vblanks = 30;
  hook->before_vblank = [this](uint64_t sequence) {
    if (sequence == 1) (void)control.switch_output(false, milliseconds(0));
  };
  const PlayResult result = play_frames(60);
  EXPECT_EQ(result.outcome, PlayOutcome::Finished) << "time passes while the output is off";
  EXPECT_EQ(recorder->shown().size(), 1u);
  EXPECT_EQ(result.report.pace.held, 29u);
  EXPECT_TRUE(result.report.off);
}

TEST_F(SteeredPlayback, TheSpeedMultipliesTheContentsRate) {
  struct Case {
    uint32_t permille;
    uint64_t vblanks;
    uint64_t shown;
  };
  // 80 frames of 30 per second on 60 Hz.
  for (const Case& one : {Case{1000, 160, 80}, Case{500, 320, 80}, Case{2000, 80, 80},
                          Case{8000, 20, 20}, Case{100, 1600, 80}}) {
    recorder = std::make_shared<test::RememberingRecorder>();
    control.set_speed(one.permille);
    const PlayResult result = play_frames(80, frames::Rate{30, 1});
    EXPECT_EQ(result.report.pace.vblanks, one.vblanks) << one.permille;
    EXPECT_EQ(result.report.pace.shown, one.shown) << one.permille;
    EXPECT_EQ(result.report.pace.skipped_planned, 80 - one.shown) << one.permille;
    EXPECT_EQ(result.report.pace.underruns + result.report.pace.missed, 0u) << one.permille;
    EXPECT_EQ(result.report.content_rate.hertz(), 0.03 * one.permille);
  }
}

TEST_F(SteeredPlayback, ANewSpeedCountsFromTheNextFrameOn) {
  options.content = frames::Rate{60, 1};
  hook->before_vblank = [this](uint64_t sequence) {
    if (sequence == 10) control.set_speed(250);
  };
  const PlayResult result = play_frames(20);
  const std::vector<DisplayedFrame> shown = recorder->shown();
  ASSERT_EQ(shown.size(), 20u);
  for (size_t k = 1; k < shown.size(); ++k) {
    const uint64_t stayed = shown[k].sequence - shown[k - 1].sequence;
    EXPECT_EQ(stayed, shown[k - 1].sequence <= 10 ? 1u : 4u) << "frame " << k - 1;
  }
  EXPECT_EQ(result.report.pace.missed + result.report.pace.underruns, 0u);
}

TEST_F(SteeredPlayback, ATimedCutIsShownAtTheSecondVblank) {
  for (const frames::Rate rate : {frames::Rate{60, 1}, frames::Rate{24, 1}, frames::Rate{4, 1}}) {
    for (uint64_t at = 30; at < 36; ++at) {
      recorder = std::make_shared<test::RememberingRecorder>();
      clock = std::make_shared<display::SimulatedClock>();
      CutSource source(rate);
      uint64_t asked_before = 0;
      hook->before_vblank = [&](uint64_t sequence) {
        if (asked_before > 0 || sequence < at) return;
        // The times of vblanks are rounded down to nanoseconds.
        const auto now = static_cast<uint64_t>(clock->now().count()) + 1;
        asked_before = now * 60 / 1'000'000'000 + 1;
        EXPECT_TRUE(control.time_next_cut());
        EXPECT_FALSE(control.time_next_cut()) << "two within a frame count once";
        source.go();
      };
      (void)play_source(source);
      EXPECT_EQ(cut_shown_at(), asked_before + 1) << rate.hertz() << " at " << at;
    }
  }
}

TEST_F(SteeredPlayback, ATimedCutMayFollowTheFrameOfTheOneBefore) {
  CutSource source(frames::Rate{60, 1});
  int cuts = 0;
  hook->before_vblank = [&](uint64_t sequence) {
    if (sequence < 30 || cuts == 2 || !control.time_next_cut()) return;
    ++cuts;
    source.go();
  };
  EXPECT_EQ(play_source(source).outcome, PlayOutcome::Finished);
  EXPECT_EQ(cuts, 2);
}

}  // namespace
}  // namespace lenticule::player
