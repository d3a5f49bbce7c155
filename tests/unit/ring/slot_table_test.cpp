// SPDX-License-Identifier: Apache-2.0
// Tests the player's slot table with honest, late, dead and lying renderers; the test writes the
// shared table by hand.
#include "frames/ring/slot_table.h"

#include <gtest/gtest.h>

#include <functional>
#include <thread>
#include <utility>

#include "tests/support/fakes/ring_peer.h"

namespace lenticule::frames {
namespace {

class SlotTableTest : public testing::Test {
 protected:
  SlotTableTest() { slot_table_.begin_connection({}); }

  void write(int slot) { ASSERT_TRUE(take_free_slot(table_[slot], slot_table_.epoch())); }
  void publish(int slot, uint64_t number, uint64_t order) {
    write(slot);
    ASSERT_TRUE(publish_slot(table_[slot], slot_table_.epoch(), number, order));
  }
  PullStatus pull() { return slot_table_.pull(frame_); }

  std::vector<SlotEntry> table_ = std::vector<SlotEntry>(4);
  SlotTable slot_table_{table_, LoopKeeping::Off};
  SlotTable::Frame frame_;
};

TEST_F(SlotTableTest, ShutsTheSlotOfARendererThatMayStillWrite) {
  write(1);
  EXPECT_EQ(slot_table_.end_connection(RendererFate::MayLive), 1);
  EXPECT_EQ(slot_table_.shut(), 1);
  slot_table_.begin_connection({});
  EXPECT_FALSE(take_free_slot(table_[1], slot_table_.epoch())) << "no renderer gets it meanwhile";
  EXPECT_TRUE(publish_slot(table_[1], 1, 0, 0)) << "the old renderer comes back from its sleep";
  EXPECT_EQ(pull(), PullStatus::NotYet) << "and is ignored";
  EXPECT_EQ(slot_table_.violations(), 0u);
  slot_table_.recover(1);
  EXPECT_EQ(slot_table_.shut(), 0);
  EXPECT_TRUE(take_free_slot(table_[1], slot_table_.epoch()));
}

TEST_F(SlotTableTest, NoticesWhatNoHonestRendererWrites) {
  const auto publish_and_pull = [&](uint64_t number) {
    publish(0, number, 0);
    EXPECT_EQ(pull(), PullStatus::Ready);
  };
  const std::vector<std::pair<const char*, std::function<void()>>> lies = {
      {"an unknown state", [&] { table_[2].word = 0; }},
      {"a state of the player", [&] { table_[2].word = slot_word(SlotState::Showing, 1); }},
      {"a foreign epoch", [&] { table_[2].word = slot_word(SlotState::Ready, 5); }},
      {"a gap in the order", [&] { publish(0, 0, 1); }},
      {"an absurd number", [&] { publish(0, UINT64_MAX, 0); }},
      {"a number that does not grow", [&] { publish_and_pull(5), publish(1, 5, 1); }},
      {"a repeated order", [&] { publish_and_pull(0), publish(1, 1, 0); }},
      {"a change of a shown slot", [&] {
         publish_and_pull(0);
         table_[0].word = slot_word(SlotState::Free, 1);
         EXPECT_TRUE(slot_table_.release(0));
       }}};
  for (const auto& [what, lie] : lies) {
    table_ = std::vector<SlotEntry>(4);
    slot_table_ = SlotTable(table_, LoopKeeping::Off);
    slot_table_.begin_connection({});
    lie();
    EXPECT_EQ(pull(), PullStatus::NotYet) << what;
    EXPECT_TRUE(slot_table_.misbehaved()) << what;
  }
}

TEST_F(SlotTableTest, NoticesAGoodbyeWithAnotherCount) {
  publish(0, 0, 0);
  slot_table_.finish_sequence(2);
  EXPECT_EQ(slot_table_.violations(), 1u);
}

TEST_F(SlotTableTest, AcceptsNoFurtherFramesAfterAViolation) {
  table_[2].word = 0;
  slot_table_.take_published();
  publish(0, 0, 0);
  EXPECT_EQ(pull(), PullStatus::NotYet);
  EXPECT_EQ(slot_table_.violations(), 1u) << "and does not count the same lie again and again";
  (void)slot_table_.end_connection(RendererFate::Dead);
  slot_table_.begin_connection({});
  EXPECT_FALSE(slot_table_.misbehaved()) << "the next one starts afresh";
  publish(0, 0, 0);
  EXPECT_EQ(pull(), PullStatus::Ready);
}

TEST_F(SlotTableTest, ViolationsDoNotAffectTheNextRenderer) {
  publish(0, 0, 0);
  publish(1, 1, 1);
  (void)slot_table_.end_connection(RendererFate::MayLive);
  table_[0].word = 0;  // taken over, waiting to be shown
  table_[2].word = 0;  // offered to the next renderer
  slot_table_.renew_offers();
  slot_table_.begin_connection({});
  ASSERT_EQ(pull(), PullStatus::Ready);
  EXPECT_EQ(slot_table_.violations(), 1u);
  EXPECT_FALSE(slot_table_.misbehaved());
  EXPECT_TRUE(take_free_slot(table_[2], slot_table_.epoch()));
}

/// The pixels are in the test's own memory, so that a thread sanitizer sees both sides: the slot
/// words alone must order every access.
TEST(SlotWords, OrderThePixelsBetweenTwoThreads) {
  constexpr int kSlots = 3;
  constexpr uint64_t kFrames = 20000;
  std::vector<SlotEntry> table(kSlots);
  std::vector<std::vector<uint8_t>> pixels(kSlots, std::vector<uint8_t>(256));
  SlotTable slot_table(table, LoopKeeping::Off);
  slot_table.begin_connection({});
  const Epoch epoch = slot_table.epoch();
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
  for (uint64_t next = 0; next < kFrames && !slot_table.misbehaved();) {
    SlotTable::Frame frame;
    if (slot_table.pull(frame) != PullStatus::Ready) {
      std::this_thread::yield();
      continue;
    }
    EXPECT_EQ(frame.number, next);
    EXPECT_EQ(test::stamped_id(pixels[frame.slot]), next);
    slot_table.release(frame.slot);
    ++next;
  }
  renderer.join();
  EXPECT_EQ(slot_table.violations(), 0u);
}

}  // namespace
}  // namespace lenticule::frames
