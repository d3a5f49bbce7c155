// SPDX-License-Identifier: Apache-2.0
// Tests when a source is reported as too slow, and with which figures.
#include "player/playlist/source_pace.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/fakes/fake_source.h"

namespace lenticule::player {
namespace {

using std::chrono::seconds;
using Time = std::chrono::steady_clock::time_point;

PlayReport report_of(uint64_t shown, uint64_t late) {
  PlayReport report;
  report.geometry = {.width = 1000, .height = 1000};
  report.content_rate = {60, 1};
  report.pace.shown = shown;
  report.pace.repeated_underrun = late;
  report.pace.underruns_after_start = late > 0 ? 1 : 0;
  return report;
}

TEST(SourcePace, IsTooSlowWhileFramesAreLateAndWarnsAtIntervals) {
  SourcePace pace;
  Time now{seconds(100)};
  EXPECT_FALSE(pace.look(report_of(60, 0), now).too_slow);
  const PaceFigures slow = pace.look(report_of(100, 20), now += seconds(1));
  EXPECT_TRUE(slow.too_slow);
  EXPECT_DOUBLE_EQ(slow.needed_fps, 60.0);
  EXPECT_DOUBLE_EQ(slow.seen_fps, 40.0);
  EXPECT_DOUBLE_EQ(slow.needed_mb_s, 180.0);
  EXPECT_DOUBLE_EQ(slow.seen_mb_s, 120.0);
  EXPECT_EQ(slow.late_frames, 20u);
  EXPECT_EQ(
      pace.warning(now),
      "too slow: needs 60.0 frames/s (180 MB/s), measured 40.0 frames/s (120 MB/s); 20 frames "
      "late so far");
  EXPECT_TRUE(pace.look(report_of(140, 40), now += seconds(1)).too_slow);
  EXPECT_FALSE(pace.warning(now)) << "a second later is no news";
  EXPECT_TRUE(pace.look(report_of(180, 60), now += seconds(9)).too_slow);
  EXPECT_TRUE(pace.warning(now));
  EXPECT_FALSE(pace.look(report_of(240, 60), now += seconds(1)).too_slow);
}

TEST(SourcePace, CountsFramesThatAHigherSpeedSkips) {
  SourcePace pace;
  PlayReport report = report_of(60, 0);
  report.content_rate = {480, 1};
  (void)pace.look(report, Time{seconds(100)});
  report.pace.shown += 60;
  report.pace.skipped_planned += 420;
  const PaceFigures figures = pace.look(report, Time{seconds(101)});
  EXPECT_DOUBLE_EQ(figures.seen_fps, 480.0);
  EXPECT_DOUBLE_EQ(figures.needed_fps, 480.0);
}

TEST(SourcePace, MeasuresNoTimeInWhichItemRateOrSpeedChanged) {
  SourcePace pace;
  Time now{seconds(100)};
  PlayReport report = report_of(60, 0);
  (void)pace.look(report, now);
  const auto look = [&](uint64_t shown) {
    report.pace.shown += shown;
    report.pace.repeated_underrun += 2;
    report.pace.underruns_after_start = 1;
    return pace.look(report, now += seconds(1));
  };
  report.content_rate = {4, 1};
  EXPECT_FALSE(look(2).too_slow) << "another rate";
  report.item = 2;
  EXPECT_FALSE(look(2).too_slow) << "another item";
  report.pace.held = 30;
  EXPECT_FALSE(look(2).too_slow) << "a pause";
  EXPECT_DOUBLE_EQ(pace.figures().seen_fps, 0.0);
  EXPECT_FALSE(look(22).too_slow) << "more than needed";
  EXPECT_FALSE(pace.warning(now));
  EXPECT_TRUE(look(2).too_slow);
  EXPECT_TRUE(pace.warning(now));
}

TEST(SourcePace, IgnoresTheFirstSecond) {
  SourcePace pace;
  PlayReport report = report_of(50, 10);
  report.pace.underruns_after_start = 0;
  (void)pace.look(report_of(0, 0), Time{seconds(1)});
  EXPECT_FALSE(pace.look(report, Time{seconds(2)}).too_slow);
}

TEST(SourcePace, ReadsASourceToItsEndOrItsError) {
  test::FakeSource good({.frames = 50});
  EXPECT_GT(SourcePace::measure(good, {1, 60}, seconds(20)).seen_fps, 0.0);
  EXPECT_EQ(good.acquired(), 0u);
  test::FakeSource broken({.frames = 50, .fails_after = 3});
  EXPECT_THROW((void)SourcePace::measure(broken, {1, 60}, seconds(20)), Error);
  test::FakeSource empty({.frames = 0});
  EXPECT_THROW((void)SourcePace::measure(empty, {1, 60}, seconds(20)), Error);
}

TEST(SourcePace, DetectsASourceSlowerThanItsRate) {
  const auto clock = display::make_monotonic_clock();
  const auto begin = clock->now();
  test::FakeSource slow({.frames = 20,
                         .ready_at =
                             [begin](uint64_t n) {
                               return begin +
                                      static_cast<int64_t>(n) * std::chrono::milliseconds(25);
                             },
                         .clock = clock});
  const PaceFigures figures = SourcePace::measure(slow, {1000, 1}, seconds(20));
  EXPECT_TRUE(figures.too_slow);
  EXPECT_LT(figures.seen_fps, 1000.0);
}

}  // namespace
}  // namespace lenticule::player
