// SPDX-License-Identifier: Apache-2.0
// Tests the player's slot table with honest, late, dead and lying renderers; the test writes the
// shared table by hand.
#include <gtest/gtest.h>

#include <thread>

#include "frames/ring/slot_ledger.h"
#include "tests/support/ring_peer.h"

namespace lenticule::frames {
namespace {

class Ledger : public testing::Test {
 protected:
  Ledger() { ledger_.begin_tenancy({}); }

  void write(int slot) { ASSERT_TRUE(take_free_slot(table_[slot], ledger_.epoch())); }
  void publish(int slot, uint64_t number, uint64_t order) {
    write(slot);
    ASSERT_TRUE(publish_slot(table_[slot], ledger_.epoch(), number, order));
  }
  PullStatus pull() { return ledger_.pull(frame_); }

  std::vector<SlotEntry> table_ = std::vector<SlotEntry>(4);
  SlotLedger ledger_{table_, LoopKeeping::Off};
  SlotLedger::Frame frame_;
};

TEST_F(Ledger, OffersEverySlotAtFirst) {
  for (int slot = 0; slot < 4; ++slot) write(slot);
  EXPECT_FALSE(ledger_.saturated());
}

TEST_F(Ledger, FollowsTheOrderOfPublishing) {
  publish(2, 0, 0);
  publish(0, 1, 1);
  publish(3, 2, 2);
  for (const int slot : {2, 0, 3}) {
    ASSERT_EQ(pull(), PullStatus::Ready);
    EXPECT_EQ(frame_.slot, slot);
  }
}

TEST_F(Ledger, MarksShownAndReleasedSlots) {
  publish(1, 0, 0);
  ASSERT_EQ(pull(), PullStatus::Ready);
  EXPECT_EQ(table_[1].word, slot_word(SlotState::Showing, 1));
  EXPECT_TRUE(ledger_.release(1));
  EXPECT_EQ(table_[1].word, slot_word(SlotState::Free, 1));
}

TEST_F(Ledger, ReclaimsHalfWrittenSlotsOfADeadRenderer) {
  publish(0, 0, 0);
  write(1);
  EXPECT_EQ(ledger_.end_tenancy(TenantFate::Dead), 0);
  EXPECT_EQ(ledger_.recovered(), 1u);
  EXPECT_EQ(ledger_.epoch(), 2u);
  EXPECT_EQ(table_[1].word, slot_word(SlotState::Free, 2));
  EXPECT_EQ(pull(), PullStatus::Ready) << "the whole frame stays playable";
  EXPECT_EQ(pull(), PullStatus::NotYet);
}

TEST_F(Ledger, ShutsTheSlotOfARendererThatMayStillWrite) {
  write(1);
  EXPECT_EQ(ledger_.end_tenancy(TenantFate::MayLive), 1);
  EXPECT_EQ(ledger_.shut(), 1);
  ledger_.begin_tenancy({});
  EXPECT_FALSE(take_free_slot(table_[1], ledger_.epoch())) << "nobody gets it meanwhile";
  EXPECT_TRUE(publish_slot(table_[1], 1, 0, 0)) << "the old renderer comes back from its sleep";
  EXPECT_EQ(pull(), PullStatus::NotYet) << "and is ignored";
  EXPECT_EQ(ledger_.violations(), 0u);
  ledger_.recover(1);
  EXPECT_EQ(ledger_.shut(), 0);
  EXPECT_TRUE(take_free_slot(table_[1], ledger_.epoch()));
}

TEST_F(Ledger, ALateRendererCannotTakeASlotOfTheNextEpoch) {
  (void)ledger_.end_tenancy(TenantFate::MayLive);
  for (SlotEntry& entry : table_) EXPECT_FALSE(take_free_slot(entry, 1));
}

TEST_F(Ledger, RecoverTouchesOnlyItsEpoch) {
  write(0);
  ASSERT_EQ(ledger_.end_tenancy(TenantFate::MayLive), 1);
  ledger_.begin_tenancy({});
  write(1);
  ASSERT_EQ(ledger_.end_tenancy(TenantFate::MayLive), 1);
  ledger_.recover(2);
  EXPECT_EQ(ledger_.shut(), 1);
  EXPECT_EQ(table_[1].word, slot_word(SlotState::Free, 3));
  EXPECT_EQ(table_[0].word, slot_word(SlotState::Writing, 1));
}

TEST_F(Ledger, FramesOfADeadRendererAreGivenBackInTheNewEpoch) {
  publish(0, 0, 0);
  (void)ledger_.end_tenancy(TenantFate::Dead);
  ledger_.begin_tenancy({});
  ASSERT_EQ(pull(), PullStatus::Ready);
  EXPECT_TRUE(ledger_.release(0));
  EXPECT_EQ(table_[0].word, slot_word(SlotState::Free, 2));
}

// No honest renderer does any of the following.
TEST_F(Ledger, NoticesAnUnknownState) {
  table_[2].word = 0;
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_TRUE(ledger_.misbehaved());
  EXPECT_EQ(ledger_.violations(), 1u);
}

TEST_F(Ledger, NoticesAStateReservedForThePlayer) {
  table_[2].word = slot_word(SlotState::Showing, 1);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesAForeignEpoch) {
  table_[2].word = slot_word(SlotState::Ready, 5);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesAGapInTheOrder) {
  publish(0, 0, 1);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesARepeatedOrder) {
  publish(0, 0, 0);
  ASSERT_EQ(pull(), PullStatus::Ready);
  publish(1, 1, 0);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesFrameNumbersThatDoNotGrow) {
  publish(0, 5, 0);
  publish(1, 5, 1);
  ASSERT_EQ(pull(), PullStatus::Ready);
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesAnAbsurdFrameNumber) {
  publish(0, UINT64_MAX, 0);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesAWithdrawnFrame) {
  publish(0, 0, 0);
  ledger_.take_published();
  table_[0].word = slot_word(SlotState::Writing, 1);
  ASSERT_EQ(pull(), PullStatus::Ready);
  EXPECT_TRUE(ledger_.misbehaved());
  EXPECT_EQ(table_[0].word, slot_word(SlotState::Showing, 1));
}

TEST_F(Ledger, NoticesAShownSlotThatIsChanged) {
  publish(0, 0, 0);
  ASSERT_EQ(pull(), PullStatus::Ready);
  table_[0].word = slot_word(SlotState::Free, 1);
  EXPECT_TRUE(ledger_.release(0));
  EXPECT_TRUE(ledger_.misbehaved());
}

TEST_F(Ledger, NoticesAGoodbyeWithAnotherCount) {
  publish(0, 0, 0);
  ledger_.finish_sequence(2);
  EXPECT_EQ(ledger_.violations(), 1u);
}

TEST_F(Ledger, AcceptsNoFurtherFramesAfterAViolation) {
  table_[2].word = 0;
  ledger_.take_published();
  publish(0, 0, 0);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_EQ(ledger_.violations(), 1u) << "and does not count the same lie again and again";
  (void)ledger_.end_tenancy(TenantFate::Dead);
  ledger_.begin_tenancy({});
  EXPECT_FALSE(ledger_.misbehaved()) << "the next one starts afresh";
  publish(0, 0, 0);
  EXPECT_EQ(pull(), PullStatus::Ready);
}

TEST_F(Ledger, ViolationsDoNotAffectTheNextRenderer) {
  publish(0, 0, 0);
  publish(1, 1, 1);
  (void)ledger_.end_tenancy(TenantFate::MayLive);
  table_[0].word = 0;  // taken over, waiting to be shown
  table_[2].word = 0;  // offered to the next renderer
  ledger_.renew_offers();
  ledger_.begin_tenancy({});
  ASSERT_EQ(pull(), PullStatus::Ready);
  EXPECT_EQ(ledger_.violations(), 1u);
  EXPECT_FALSE(ledger_.misbehaved());
  EXPECT_TRUE(take_free_slot(table_[2], ledger_.epoch()));
}

/// The pixels are in the test's own memory, so that a thread sanitizer sees both sides: the slot
/// words alone must order every access.
TEST(SlotWords, OrderThePixelsBetweenTwoThreads) {
  constexpr int kSlots = 3;
  constexpr uint64_t kFrames = 20000;
  std::vector<SlotEntry> table(kSlots);
  std::vector<std::vector<uint8_t>> pixels(kSlots, std::vector<uint8_t>(256));
  SlotLedger ledger(table, LoopKeeping::Off);
  ledger.begin_tenancy({});
  const Epoch epoch = ledger.epoch();
  std::thread renderer([&] {
    for (uint64_t k = 0; k < kFrames; ++k) {
      int slot = 0;
      while (!take_free_slot(table[slot], epoch)) {
        slot = (slot + 1) % kSlots;
        std::this_thread::yield();
      }
      test::stamp_frame(pixels[slot], k);
      EXPECT_TRUE(publish_slot(table[slot], epoch, k, k));
    }
  });
  for (uint64_t next = 0; next < kFrames && !ledger.misbehaved();) {
    SlotLedger::Frame frame;
    if (ledger.pull(frame) != PullStatus::Ready) {
      std::this_thread::yield();
      continue;
    }
    EXPECT_EQ(frame.number, next);
    EXPECT_EQ(test::stamped_id(pixels[frame.slot]), next);
    ledger.release(frame.slot);
    ++next;
  }
  renderer.join();
  EXPECT_EQ(ledger.violations(), 0u);
}

}  // namespace
}  // namespace lenticule::frames
