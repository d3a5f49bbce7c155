// SPDX-License-Identifier: Apache-2.0
// Tests how frames that come in live are shown: the newest one at the next vblank, for a simulated
// hour of clocks that differ.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>

#include "display/virtual/virtual_display.h"
#include "player/playback/playback.h"
#include "tests/support/fakes/fake_source.h"

namespace lenticule::player {
namespace {

using display::Nanoseconds;
using std::chrono::hours;
using std::chrono::milliseconds;

constexpr frames::FrameGeometry kSmall{.width = 16, .height = 8};

/// A camera with its own clock. Only the newest frame can be pulled.
class LiveSource final : public test::PlainSource {
 public:
  LiveSource(std::shared_ptr<display::Clock> clock, Nanoseconds period, Nanoseconds end)
      : clock_(std::move(clock)), period_(period), end_(end), frame_(kSmall) {}
  [[nodiscard]] frames::FrameGeometry geometry() const override { return kSmall; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    if (clock_->now() >= end_) return frames::PullStatus::End;
    const auto newest = static_cast<uint64_t>(clock_->now() / period_);
    if (newest == last_) return frames::PullStatus::NotYet;
    skipped += newest - last_ - 1;
    last_ = newest;
    out = {.frame = frame_.view(),
           .number = newest,
           .captured_ns = static_cast<int64_t>(newest) * period_.count()};
    return frames::PullStatus::Ready;
  }
  [[nodiscard]] bool nothing_due() const override { return true; }
  [[nodiscard]] uint64_t last() const { return last_; }

  uint64_t skipped = 0;

 private:
  std::shared_ptr<display::Clock> clock_;
  Nanoseconds period_, end_;
  frames::WovenFrame frame_;
  uint64_t last_ = 0;
};

struct LiveRun {
  PlayReport report;
  uint64_t skipped;
  uint64_t taken;
};

LiveRun play_live(Nanoseconds period, Nanoseconds length) {
  const auto clock = std::make_shared<display::SimulatedClock>();
  LiveSource source(clock, period, clock->now() + length);
  const auto display = display::open_virtual_display(
      {.geometry = kSmall, .refresh = {60, 1}, .buffers = 3, .clock = clock});
  const PlaybackOptions options{.prime = 1, .filling = Filling::InPresenter, .source_name = "live"};
  PlayResult result = play(*display, source, options);
  EXPECT_EQ(result.outcome, PlayOutcome::Finished);
  return {result.report, source.skipped, source.last()};
}

void expect_bound(const LiveRun& run, Nanoseconds period) {
  const double most_us = static_cast<double>((period + milliseconds(17)).count()) / 1000.0;
  EXPECT_LE(run.report.capture_to_submit.max_us, most_us);
  EXPECT_EQ(run.report.pace.missed, 0u);
  EXPECT_EQ(run.report.pace.underruns, 0u);
}

TEST(LivePlayback, SlowClockRepeatsAFrameAtTheBeat) {
  constexpr Nanoseconds kPeriod{16'668'333};  // 100 ppm slower than the panel
  const LiveRun run = play_live(kPeriod, hours(1));
  expect_bound(run, kPeriod);
  const auto vblanks = static_cast<double>(run.report.pace.vblanks);
  EXPECT_NEAR(vblanks, 60.0 * 3'600, 10);
  EXPECT_NEAR(static_cast<double>(run.report.pace.held), vblanks * 1e-4, 5);
  EXPECT_LE(run.report.frames_superseded + run.skipped, 5u);
}

TEST(LivePlayback, FastClockDropsAFrameAtTheBeat) {
  constexpr Nanoseconds kPeriod{16'665'000};  // 100 ppm faster
  const LiveRun run = play_live(kPeriod, hours(1));
  expect_bound(run, kPeriod);
  const double dropped = static_cast<double>(run.report.frames_superseded + run.skipped);
  EXPECT_NEAR(dropped, static_cast<double>(run.report.pace.vblanks) * 1e-4, 10);
  EXPECT_LE(run.report.pace.held, 10u);
}

TEST(LivePlayback, OtherRatesAreShownAtOnce) {
  for (const Nanoseconds period : {milliseconds(40), milliseconds(33), milliseconds(8)}) {
    const LiveRun run = play_live(period, milliseconds(60'000));
    expect_bound(run, period);
    const double expected = std::min(60e9 / static_cast<double>(period.count()), 3600.0);
    EXPECT_NEAR(static_cast<double>(run.report.pace.shown), expected, 10) << period.count();
  }
}

}  // namespace
}  // namespace lenticule::player
