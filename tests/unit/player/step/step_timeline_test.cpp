// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "player/step/step_pacing.h"

namespace lenticule::player {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

constexpr StepTimeline kFilm{.frame = 10, .due = seconds(100), .rate = {50, 1}, .loop_frames = 100};

TEST(StepTimeline, MeasuresAgainstTheNearestRepetition) {
  EXPECT_EQ(kFilm.lateness(10, seconds(102)), nanoseconds{0});
  EXPECT_EQ(kFilm.lateness(9, seconds(102)), milliseconds(20));
  EXPECT_EQ(kFilm.lateness(99, seconds(100)), milliseconds(220));
  EXPECT_EQ(kFilm.lateness(10, seconds(96) - milliseconds(1)), milliseconds(-1));
}

TEST(StepTimeline, IsTheSameWhenStatedForALaterFrame) {
  const StepTimeline later = kFilm.stated_after(hours(24 * 365));
  EXPECT_GT(later.due, hours(24 * 365));
  EXPECT_LE(later.due, hours(24 * 365) + milliseconds(20));
  EXPECT_LT(later.frame, 100u);
  EXPECT_EQ(kFilm.lateness(later.frame, later.due), nanoseconds{0});
  const StepTimeline earlier = kFilm.stated_after(seconds(1));
  EXPECT_EQ(kFilm.lateness(earlier.frame, earlier.due), nanoseconds{0});
}

TEST(StepTimeline, WithoutALoopNoFrameBeforeTheFirstIsStated) {
  StepTimeline once = kFilm;
  once.loop_frames = 0;
  const StepTimeline first = once.stated_after(seconds(1));
  EXPECT_EQ(first.frame, 0u);
  EXPECT_EQ(first.due, seconds(100) - milliseconds(200));
}

TEST(StepTimeline, KeepsBroadcastRatesExactlyForAYear) {
  const StepTimeline film{.rate = {60'000, 1001}, .loop_frames = 60'000};
  const nanoseconds year = seconds(1001) * 31'000;
  EXPECT_EQ(film.lateness(0, year), nanoseconds{0});
}

}  // namespace
}  // namespace lenticule::player
