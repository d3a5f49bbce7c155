// SPDX-License-Identifier: Apache-2.0
#include "player/playback/pacing.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace lenticule::player {
namespace {

/// Shows frame() at vblank `target`; the flip completes at `landed`.
void flip(Pacer& pacer, uint64_t target, uint64_t landed) {
  EXPECT_EQ(pacer.decide(target, true), PaceDecision::Submit);
  pacer.submitted(target);
  pacer.flipped(landed);
}
void flip(Pacer& pacer, uint64_t target) { flip(pacer, target, target); }

Pacer started(LatePolicy policy, frames::Rate content = {60, 1}) {
  Pacer pacer(content, {60, 1}, policy);
  flip(pacer, 100);
  return pacer;
}

TEST(Pacer, AShiftForwardsHoldsOneFrameAVblankLonger) {
  Pacer pacer = started(LatePolicy::Drop);
  EXPECT_EQ(pacer.shift(1.0), 1);
  EXPECT_EQ(pacer.decide(101, true), PaceDecision::Later);
  flip(pacer, 102);
  EXPECT_EQ(pacer.due(), 103u);
  EXPECT_EQ(pacer.counts().dropped, 0u);
}

TEST(Pacer, AShiftBackwardsLeavesOneFrameOut) {
  Pacer pacer = started(LatePolicy::Drop);
  EXPECT_EQ(pacer.shift(-1.0), -1);
  EXPECT_EQ(pacer.decide(101, true), PaceDecision::Skip);
  flip(pacer, 101);
  EXPECT_EQ(pacer.frame(), 3u);
  EXPECT_EQ(pacer.counts().missed, 0u);
}

TEST(Pacer, AShiftBackwardsShortensARepeatedFrame) {
  Pacer pacer = started(LatePolicy::Drop, {30, 1});
  EXPECT_EQ(pacer.shift(-1.0), -1);
  flip(pacer, 101);
  EXPECT_EQ(pacer.frame(), 2u);
  EXPECT_EQ(pacer.due(), 103u);
  EXPECT_EQ(pacer.counts().dropped, 0u);
}

TEST(Pacer, FractionsOfAShiftAddUpToOneVblank) {
  Pacer pacer = started(LatePolicy::Drop);
  int moved = 0;
  for (int k = 0; k < 50; ++k) moved += pacer.shift(0.05);
  EXPECT_NEAR(pacer.vblanks_to_ideal(100), 3.5, 1e-3);
  EXPECT_EQ(moved, 2);
  EXPECT_EQ(pacer.due(), 103u);
}

TEST(Pacer, DropGivesUpAfterEightFramesAndSlips) {
  Pacer pacer = started(LatePolicy::Drop);
  EXPECT_EQ(pacer.decide(101, false), PaceDecision::Starved);
  for (int k = 0; k < kMaxConsecutiveDrops; ++k)
    EXPECT_EQ(pacer.decide(200, true), PaceDecision::Skip);
  flip(pacer, 200);
  EXPECT_EQ(pacer.frame(), 10u);
  EXPECT_EQ(pacer.due(), 201u);
  EXPECT_EQ(pacer.counts().slipped, 200u - 109u);
}

TEST(Pacer, DropKeepsALateFrameWhoseSuccessorIsNotDue) {
  Pacer pacer = started(LatePolicy::Drop, {30, 1});
  EXPECT_EQ(pacer.decide(102, false), PaceDecision::Starved);
  flip(pacer, 103);
  EXPECT_EQ(pacer.due(), 104u);
  EXPECT_EQ(pacer.counts().dropped, 0u);
}

TEST(Pacer, AFrameReadyJustInTimeIsNoUnderrun) {
  Pacer pacer = started(LatePolicy::Slip);
  EXPECT_EQ(pacer.decide(101, false), PaceDecision::Starved);
  flip(pacer, 101);
  EXPECT_EQ(pacer.counts().underruns, 0u);
}

TEST(Pacer, AFrameThatWasReadyTooLateForItsVblankIsAnUnderrunNotAMiss) {
  Pacer pacer = started(LatePolicy::Slip);
  EXPECT_EQ(pacer.decide(101, false), PaceDecision::Starved);
  EXPECT_EQ(pacer.decide(101, true), PaceDecision::Submit);
  pacer.submitted(101, false);
  pacer.flipped(103);
  EXPECT_EQ(pacer.counts().repeated_underrun, 1u);
  EXPECT_EQ(pacer.counts().missed, 1u);
}

TEST(Pacer, ALateSubmissionOfAFrameThatWasReadyIsAMiss) {
  Pacer pacer = started(LatePolicy::Slip);
  EXPECT_EQ(pacer.decide(101, true), PaceDecision::Submit);
  pacer.submitted(101, false);
  pacer.flipped(102);
  EXPECT_EQ(pacer.counts().repeated_underrun, 0u);
  EXPECT_EQ(pacer.counts().missed, 1u);
}

}  // namespace
}  // namespace lenticule::player
