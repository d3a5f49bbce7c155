// SPDX-License-Identifier: Apache-2.0
#include "player/step/step_pacing.h"

#include <gtest/gtest.h>

#include <cmath>

namespace lenticule::player {
namespace {

using std::chrono::nanoseconds;

constexpr nanoseconds kPeriod{20'000'000};

/// A player of 50 frames per second on 50 Hz: `late` is the lateness of its schedule in vblanks.
class Schedule {
 public:
  explicit Schedule(StepPacing& pacing, double late) : pacing_(pacing), late_(late) {}

  /// Reaches the next vblank with the next frame. Returns the correction.
  double next() {
    ++frame_;
    const double ideal =
        (static_cast<double>(frame_) + late_) * static_cast<double>(kPeriod.count());
    const double shift = pacing_.correction({.frame = frame_,
                                             .index = frame_,
                                             .vblank = frame_,
                                             .due = nanoseconds(static_cast<int64_t>(ideal)),
                                             .period = kPeriod,
                                             .rate = {50, 1}});
    late_ += shift;
    return shift;
  }
  void drift(double vblanks) { late_ += vblanks; }

 private:
  StepPacing& pacing_;
  double late_;
  uint64_t frame_ = 100;
};

void follow_from_zero(StepPacing& pacing) {
  pacing.follow({.frame = 0, .due = nanoseconds{0}, .rate = {50, 1}});
}

TEST(StepPacing, JoinsByAtMostOneVblankInFour) {
  for (const double late : {30.3, -30.3}) {
    StepPacing pacing;
    follow_from_zero(pacing);
    Schedule schedule(pacing, late);
    int corrections = 0;
    for (int k = 0; k < 4 * 31; ++k) {
      const double shift = schedule.next();
      EXPECT_LE(std::abs(shift), 1.0);
      EXPECT_LE(shift * late, 0.0);
      corrections += shift != 0.0 ? 1 : 0;
    }
    (void)schedule.next();
    EXPECT_EQ(corrections, 31);
    EXPECT_EQ(pacing.place().in_step, 1u) << late;
    EXPECT_EQ(pacing.place().joined, 1u);
  }
}

TEST(StepPacing, CorrectsADriftingPanelInSmallStepsAtMostOnceInSixtyVblanks) {
  StepPacing pacing;
  follow_from_zero(pacing);
  Schedule schedule(pacing, 0.0);
  int since = 1000;
  for (int k = 0; k < 10'000; ++k, ++since) {
    schedule.drift(2e-4);
    const double shift = schedule.next();
    if (shift == 0.0) continue;
    EXPECT_GE(since, static_cast<int>(kStepTrackingVblanks));
    EXPECT_NEAR(shift, -kStepTolerance, 0.01);
    since = 0;
  }
  EXPECT_NEAR(static_cast<double>(pacing.place().drift_ppb), 200'000.0, 1'000.0);
}

TEST(StepPacing, LearnsTheLengthOfTheLoopWhenFramesWereLeftOut) {
  StepPacing pacing;
  const auto frame = [&](uint64_t number, uint64_t index) {
    (void)pacing.correction({.frame = number, .index = index, .vblank = index, .period = kPeriod});
  };
  frame(8, 8);
  EXPECT_EQ(pacing.place().loop_frames, 0u);
  frame(1, 11);  // frames 9 and 0 were left out
  EXPECT_EQ(pacing.place().loop_frames, 10u);
}

}  // namespace
}  // namespace lenticule::player
