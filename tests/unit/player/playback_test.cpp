// SPDX-License-Identifier: Apache-2.0
// Tests playing in simulated time: every vblank of every case is the same on every run.
#include "player/playback/playback.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "display/virtual/virtual_display.h"
#include "frames/decoded_source.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_source.h"
#include "tests/support/fakes/faulty_display.h"

namespace lenticule::player {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::DisplayedFrame;
using test::EventFate;
using test::FakeSource;
using test::FakeSourceScript;

constexpr frames::FrameGeometry kSmall{.width = 16, .height = 8};

class Playback : public testing::Test {
 protected:
  std::shared_ptr<display::SimulatedClock> clock = std::make_shared<display::SimulatedClock>();
  std::shared_ptr<test::ScriptedFaults> faults = std::make_shared<test::ScriptedFaults>();
  std::shared_ptr<test::RememberingRecorder> recorder =
      std::make_shared<test::RememberingRecorder>();
  FakeSourceScript script{.geometry = kSmall, .clock = clock};
  PlaybackOptions options{.filling = Filling::InPresenter, .source_name = "fake"};

  PlayResult play_script() {
    FakeSource source(script);
    const auto display = test::open_virtual_display(
        {.geometry = kSmall, .refresh = {60, 1}, .clock = clock, .recorder = recorder}, faults);
    PlayResult result = play(*display, source, options);
    EXPECT_EQ(source.acquired(), 0u) << "frames were not given back";
    const PaceCounts& pace = result.report.pace;
    EXPECT_EQ(pace.vblanks, pace.shown + pace.repeated_planned + pace.repeated_underrun +
                                pace.missed + pace.held);
    return result;
  }

  /// Delays frame `number` of loop 0 until `until`; all other frames are ready at once.
  void delay_frame(uint64_t number, display::Nanoseconds until) {
    script.ready_at = [number, until](uint64_t n) {
      return n == number ? until : display::Nanoseconds{0};
    };
  }

  [[nodiscard]] std::vector<uint64_t> shown_ids() const {
    std::vector<uint64_t> ids;
    for (const DisplayedFrame& displayed : recorder->shown()) ids.push_back(displayed.id);
    return ids;
  }
  [[nodiscard]] std::vector<uint64_t> shown_vblanks() const {
    std::vector<uint64_t> vblanks;
    for (const DisplayedFrame& displayed : recorder->shown()) vblanks.push_back(displayed.sequence);
    return vblanks;
  }
};

std::vector<uint64_t> count_to(uint64_t end) {
  std::vector<uint64_t> numbers(end);
  for (uint64_t i = 0; i < end; ++i) numbers[i] = i;
  return numbers;
}

TEST_F(Playback, ShowsFilmInItsCadenceAndTheLastFrameInFull) {
  options.content = frames::Rate{24, 1};
  script.frames = 24;
  const PlayResult result = play_script();
  EXPECT_EQ(result.report.pace.vblanks, 60u);
  EXPECT_EQ(result.report.pace.shown, 24u);
  EXPECT_EQ(result.report.pace.repeated_planned, 36u);
  const std::vector<uint64_t> vblanks = shown_vblanks();
  for (size_t k = 0; k < vblanks.size(); ++k) EXPECT_EQ(vblanks[k], 1 + k * 5 / 2) << "frame " << k;
}

TEST_F(Playback, UsesTheSourcesOwnRate) {
  script.rate = frames::Rate{30, 1};
  EXPECT_EQ(play_script().report.pace.vblanks, 20u);
}

TEST_F(Playback, LoopsWithoutAGapTenThousandTimes) {
  script.frames = 3;
  options.loops = 10'000;
  options.content = frames::Rate{24, 1};
  const PlayResult result = play_script();
  EXPECT_EQ(result.report.loops, 10'000u);
  EXPECT_EQ(result.report.pace.underruns, 0u);
  EXPECT_EQ(result.report.pace.missed, 0u);
  const std::vector<DisplayedFrame> shown = recorder->shown();
  ASSERT_EQ(shown.size(), 30'000u);
  const uint64_t checksums[3] = {test::checksum_of(test::numbered_frame(kSmall, 0).view()),
                                 test::checksum_of(test::numbered_frame(kSmall, 1).view()),
                                 test::checksum_of(test::numbered_frame(kSmall, 2).view())};
  for (uint64_t k = 0; k < shown.size(); ++k)
    ASSERT_EQ(shown[k], (DisplayedFrame{1 + k * 5 / 2, k, checksums[k % 3]}));
}

TEST_F(Playback, SlipShowsEveryFrameAfterAnUnderrun) {
  delay_frame(5, milliseconds(150));  // due at vblank 6, ready after vblank 9
  const PlayResult result = play_script();
  EXPECT_THAT(shown_vblanks(), testing::ElementsAre(1, 2, 3, 4, 5, 10, 11, 12, 13, 14));
  EXPECT_EQ(shown_ids(), count_to(10));
  EXPECT_EQ(result.report.pace.repeated_underrun, 4u);
  EXPECT_EQ(result.report.pace.underruns, 1u);
  EXPECT_EQ(result.report.pace.slipped, 4u);
}

TEST_F(Playback, DropReturnsToTheScheduleAfterAnUnderrun) {
  script.frames = 20;
  options.late = LatePolicy::Drop;
  delay_frame(5, milliseconds(150));
  const PlayResult result = play_script();
  EXPECT_EQ(result.report.pace.dropped, 4u);
  EXPECT_EQ(result.report.pace.shown, 16u);
  EXPECT_EQ(result.report.pace.vblanks, 20u);
  for (const DisplayedFrame& displayed : recorder->shown())
    EXPECT_EQ(displayed.sequence, displayed.id + 1);
}

TEST_F(Playback, HoldWaitsUntilTheSourceIsPrimedAgain) {
  options.late = LatePolicy::Hold;
  delay_frame(5, milliseconds(150));
  const PlayResult result = play_script();
  EXPECT_EQ(shown_ids(), count_to(10));
  EXPECT_EQ(result.report.pace.underruns, 1u);
}

TEST_F(Playback, SkipsByPlanWhenContentIsFasterThanTheDisplay) {
  options.content = frames::Rate{120, 1};
  const PlayResult result = play_script();
  EXPECT_THAT(shown_ids(), testing::ElementsAre(0, 2, 4, 6, 8));
  EXPECT_EQ(result.report.pace.skipped_planned, 5u);
  EXPECT_EQ(result.report.pace.dropped, 0u);
  EXPECT_EQ(result.report.pace.vblanks, 5u);
}

/// Makes a source of numbered frames with a pool.
class PooledSource final : public frames::DecodedSource {
 public:
  explicit PooledSource(int pool) : DecodedSource("pool", std::make_unique<Numbers>(pool)) {}

 private:
  struct Numbers final : frames::FrameDecoding {
    explicit Numbers(int frames) : pool(frames) {}
    frames::DecodedRounds rounds() const override {
      return {.geometry = kSmall, .last = 23, .pool_frames = pool, .decoder_threads = 2};
    }
    std::string decode(int, uint64_t frame, uint64_t, frames::WovenFrame& to) override {
      to = test::numbered_frame(kSmall, frame);
      return {};
    }
    int pool;
  };
};

TEST_F(Playback, EveryStepThroughEveryPoolMakesProgress) {
  PlaybackControl control;
  const auto reconnects = [](const LostDisplay&) { return ReconnectResult::GivenUp; };
  for (int pool = 2; pool <= 9; ++pool)
    for (uint64_t step = 1; step <= 10; ++step)
      for (const int keeping : {0, 1, 2, 3}) {
        recorder = std::make_shared<test::RememberingRecorder>();
        clock = std::make_shared<display::SimulatedClock>();
        PooledSource source(pool);
        const auto display = display::open_virtual_display(
            {.geometry = kSmall, .buffers = 2 + pool % 3, .clock = clock, .recorder = recorder});
        options.content = frames::Rate{static_cast<int64_t>(60 * step), 1};
        options.loops = kForever;
        options.vblanks = 20;
        options.reconnect = keeping % 2 == 1 ? reconnects : decltype(options.reconnect)();
        options.control = keeping >= 2 ? &control : nullptr;
        const PlayResult result = play(*display, source, options);
        ASSERT_EQ(result.report.pace.shown, 20u) << pool << " slots, " << step << " frames";
        const std::vector<DisplayedFrame> shown = recorder->shown();
        for (uint64_t k = 0; k < shown.size(); ++k)
          ASSERT_EQ(shown[k].checksum,
                    test::checksum_of(test::numbered_frame(kSmall, k * step % 23).view()))
              << pool << " slots, " << step << " frames";
      }
}

TEST_F(Playback, StartsAtTheSameSimulatedVblankHoweverLongDecodingTakes) {
  options.prime = 8;
  options.vblanks = 20;
  options.loops = kForever;
  for (int run = 0; run < 20; ++run) {
    recorder = std::make_shared<test::RememberingRecorder>();
    PooledSource source(9);
    const auto display =
        display::open_virtual_display({.geometry = kSmall,
                                       .clock = clock = std::make_shared<display::SimulatedClock>(),
                                       .recorder = recorder});
    (void)play(*display, source, options);
    EXPECT_EQ(shown_vblanks().front(), 1u);
  }
}

TEST_F(Playback, TheSummarySaysWhetherAFrameWasShown) {
  EXPECT_THAT(summary_text(play_script().report), testing::HasSubstr("first frame after "));
  EXPECT_THAT(summary_text({}), testing::HasSubstr("no frame was shown"));
}

TEST_F(Playback, EventsThatComeLaterThanAPeriodAreMissedVblanks) {
  faults->delays[4] = milliseconds(25);
  const PlayResult result = play_script();
  EXPECT_EQ(result.report.pace.missed, 1u);
  EXPECT_EQ(result.report.pace.underruns, 0u);
  EXPECT_THAT(shown_vblanks(), testing::ElementsAre(1, 2, 3, 4, 6, 7, 8, 9, 10, 11));
}

TEST_F(Playback, CountsALostFlipEventAndPlaysOn) {
  faults->fates[4] = EventFate::Drop;
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.flip_timeouts, 1u);
  EXPECT_EQ(shown_ids(), count_to(10));
}

TEST_F(Playback, ADisplayThatNeverAnswersIsLost) {
  faults->otherwise = EventFate::Drop;
  script.frames = 100;
  EXPECT_EQ(play_script().outcome, PlayOutcome::DisplayLost);
}

TEST_F(Playback, ALostVblankEventIsRequestedAgain) {
  options.content = frames::Rate{20, 1};
  faults->fates[3] = EventFate::Drop;  // the vblank event before the second frame
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(shown_ids(), count_to(10));
  EXPECT_GE(result.report.vblank_timeouts, 1u);
}

TEST_F(Playback, SlowContentLosesNoVblankEvent) {
  options.content = frames::Rate{1, 2};
  const PlayResult result = play_script();
  EXPECT_EQ(result.report.vblank_timeouts, 0u);
  EXPECT_EQ(result.report.pace.vblanks, 1200u);
  EXPECT_EQ(result.report.pace.missed, 0u);
}

TEST_F(Playback, DuplicateEventsAreIgnored) {
  faults->otherwise = EventFate::Duplicate;
  const PlayResult result = play_script();
  EXPECT_EQ(shown_ids(), count_to(10));
  EXPECT_GE(result.report.stray_events, 9u);
  EXPECT_EQ(result.report.pace.vblanks, 10u);
}

TEST_F(Playback, AnUnpluggedDisplayEndsPlaying) {
  faults->fates[5] = EventFate::Unplug;
  EXPECT_EQ(play_script().outcome, PlayOutcome::DisplayLost);
  EXPECT_EQ(shown_ids(), count_to(5));
}

TEST_F(Playback, ABrokenSourcesLastFrameIsShownForItsFullTime) {
  script.fails_after = 5;
  options.content = frames::Rate{30, 1};
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::SourceFailed);
  EXPECT_EQ(result.failure, "the fake source broke");
  EXPECT_EQ(shown_ids(), count_to(5));
  EXPECT_EQ(result.report.pace.vblanks, 10u);
  EXPECT_EQ(result.report.pace.underruns, 0u);
}

TEST_F(Playback, AStalledSourceEndsPlayingAfterItsTimeout) {
  delay_frame(5, seconds(100'000));
  options.stall_timeout = seconds(7);
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::SourceStalled);
  EXPECT_EQ(shown_ids(), count_to(5));
  EXPECT_GE(clock->now(), seconds(7));
  EXPECT_LE(clock->now(), seconds(8));
  EXPECT_GE(result.report.delays.source, 6.5);
}

TEST_F(Playback, WaitsForeverOnRequest) {
  delay_frame(5, seconds(1000));
  options.stall_timeout.reset();
  EXPECT_EQ(play_script().outcome, PlayOutcome::Finished);
  EXPECT_EQ(shown_ids(), count_to(10));
}

TEST_F(Playback, StartsWithAvailableFramesIfPrimingTakesTooLong) {
  class NeverSaturated final : public test::PlainSource {
   public:
    explicit NeverSaturated(FakeSource& inner) : inner_(inner) {}
    frames::FrameGeometry geometry() const override { return inner_.geometry(); }
    frames::PullStatus pull(frames::AcquiredFrame& out) override { return inner_.pull(out); }
    void release(uint64_t token) override { inner_.release(token); }
    int max_acquired() const override { return inner_.max_acquired(); }
    uint64_t ready_count() const override { return 0; }
    bool saturated() const override { return false; }

   private:
    FakeSource& inner_;
  };
  FakeSource inner(script);
  NeverSaturated source(inner);
  const auto display =
      display::open_virtual_display({.geometry = kSmall, .clock = clock, .recorder = recorder});
  options.prime = 1000;
  options.prime_timeout = seconds(1);
  EXPECT_EQ(play(*display, source, options).outcome, PlayOutcome::Finished);
  EXPECT_EQ(shown_ids(), count_to(10));
  EXPECT_GE(recorder->shown().front().sequence, 60u);
}

TEST_F(Playback, StopsAfterTheRequestedVblanks) {
  options.loops = kForever;
  options.vblanks = 35;
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  EXPECT_EQ(result.report.pace.vblanks, 35u);
  EXPECT_EQ(shown_ids(), count_to(35));
}

TEST_F(Playback, ReportsASequenceThatCannotBePlayedAgain) {
  script.can_rewind = false;
  options.loops = 2;
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::SourceFailed);
  EXPECT_THAT(result.failure, testing::HasSubstr("repeated"));
  EXPECT_EQ(shown_ids(), count_to(10));
}

TEST_F(Playback, LoopingForeverWaitsForTheNextSequenceWithoutAnUnderrun) {
  script.can_rewind = false;
  options.loops = kForever;
  options.stall_timeout = seconds(2);
  const PlayResult result = play_script();
  EXPECT_EQ(result.outcome, PlayOutcome::SourceStalled);
  EXPECT_EQ(result.report.pace.underruns, 0u);
  EXPECT_GE(result.report.pace.held, 100u);
  EXPECT_EQ(result.report.delays.source, 0.0) << "no frame is due";
}

TEST_F(Playback, AnEmptySequenceIsAnError) {
  script.frames = 0;
  options.loops = kForever;
  EXPECT_EQ(play_script().outcome, PlayOutcome::SourceFailed);
}

TEST_F(Playback, RefusesFramesOfAnotherSize) {
  script.geometry.width = 15;
  test::expect_error(test::error_of([this] { (void)play_script(); }), ErrorKind::Input, "15x8",
                     "16x8");
}

TEST_F(Playback, TheJsonReportHasTheReportsNumbers) {
  options.content = frames::Rate{24, 1};
  const PlayResult result = play_script();
  const nlohmann::ordered_json json = to_json(result.report);
  EXPECT_EQ(json.at("shown"), 10);
  EXPECT_EQ(json.at("vblanks"), 25);
  EXPECT_EQ(json.at("repeated_planned"), 15);
  EXPECT_EQ(json.at("underruns_after_start"), 0);
  EXPECT_EQ(json.at("content_rate"), "24");
  EXPECT_EQ(json.at("clock"), "software");
  EXPECT_EQ(json.at("outcome"), "finished");
  EXPECT_EQ(json.at("submit_to_flip_us").at("count"), 10);
  EXPECT_GT(json.at("resident_bytes").at("total"), 0);
}

}  // namespace
}  // namespace lenticule::player
