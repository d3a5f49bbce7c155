// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "display/kms/scanout/page_flip.h"

namespace lenticule::test {

using display::kNever;
using display::Nanoseconds;
using display::PendingFlip;
using Phase = display::PendingFlip::Phase;

constexpr Nanoseconds kNow = std::chrono::seconds(5);
constexpr Nanoseconds kLater = std::chrono::seconds(6);

TEST(PendingFlip, WaitsForNothingWhenThereIsNone) {
  PendingFlip flip;
  EXPECT_EQ(flip.phase(), Phase::None);
  EXPECT_EQ(flip.due(), kNever);
  EXPECT_FALSE(flip.under_way());
  EXPECT_FALSE(flip.awaits(0));
  flip.stick(kNow);
  EXPECT_EQ(flip.phase(), Phase::None) << "nothing can be stuck";
}

TEST(PendingFlip, GoesFromQueuedToDisplayed) {
  PendingFlip flip;
  flip.queue(nullptr, 42);
  EXPECT_TRUE(flip.is_due(Phase::Queued, kNow));
  flip.arm(7, kLater);
  EXPECT_TRUE(flip.awaits(7));
  EXPECT_FALSE(flip.awaits(8));
  EXPECT_FALSE(flip.is_due(Phase::Armed, kNow));
  EXPECT_TRUE(flip.is_due(Phase::Armed, kLater));
  flip.land({.sequence = 100, .time = kNow}, kLater);
  EXPECT_FALSE(flip.awaits(7)) << "the event of a landed flip is a stray one";
  EXPECT_FALSE(flip.under_way());
  EXPECT_FALSE(flip.is_due(Phase::Landed, kNow));
  const PendingFlip::Landed landed = flip.deliver();
  EXPECT_EQ(landed.id, 42U);
  EXPECT_EQ(landed.vblank.sequence, 100U);
  EXPECT_EQ(flip.phase(), Phase::None);
  EXPECT_EQ(flip.due(), kNever);
}

TEST(PendingFlip, IsStuckAfterFiveRefusals) {
  PendingFlip flip;
  flip.queue(nullptr, 1);
  for (int i = 0; i < 5; ++i) {
    flip.put_off(kNow);
    EXPECT_EQ(flip.phase(), Phase::Queued);
  }
  flip.put_off(kLater);
  EXPECT_EQ(flip.phase(), Phase::Stuck);
  EXPECT_EQ(flip.due(), kLater);
}

TEST(PendingFlip, CountsRefusalsOfOneFlipOnly) {
  PendingFlip flip;
  for (int i = 0; i < 10; ++i) {
    flip.queue(nullptr, 1);
    flip.put_off(kNow);
    flip.put_off(kNow);
    EXPECT_EQ(flip.phase(), Phase::Queued);
    flip.arm(1, kLater);
    flip.land({}, kNow);
    (void)flip.deliver();
  }
}

TEST(PendingFlip, CanGetStuckInEveryPhase) {
  PendingFlip flip;
  flip.queue(nullptr, 1);
  flip.stick(kNow);
  EXPECT_TRUE(flip.is_due(Phase::Stuck, kNow));
  flip.stick(kLater);
  EXPECT_EQ(flip.due(), kLater);
  flip.queue(nullptr, 2);
  flip.arm(3, kLater);
  flip.stick(kNow);
  EXPECT_FALSE(flip.awaits(3));
  flip.land({}, kNow);
  flip.stick(kLater);
  EXPECT_EQ(flip.phase(), Phase::Landed) << "the displayed frame is no longer stuck";
  flip.queue(nullptr, 4);
  flip.withdraw();
  EXPECT_EQ(flip.phase(), Phase::None);
}

}  // namespace lenticule::test
