// SPDX-License-Identifier: Apache-2.0
// Tests random histories of renderers and a player against a simple model: a std::deque of frames.
#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <random>
#include <set>

#include "frames/ring/slot_table.h"

namespace lenticule::frames {
namespace {

/// The expected result of pull(): a frame, or the end of a sequence.
struct Expected {
  bool end = false;
  uint64_t number = 0;
};

/// One random history. Renderers are honest, but die, leave and come at any time.
class History {
 public:
  History(int slots, LoopKeeping keeping, unsigned seed)
      : table_(static_cast<size_t>(slots)), slot_table_(table_, keeping), random_(seed) {}

  void step() {
    switch (random_() % 12) {
      case 0:
      case 1:
      case 2:
        return take();
      case 3:
      case 4:
      case 5:
        return publish();
      case 6:
      case 7:
      case 8:
        return pull();
      case 9:
      case 10:
        return release();
      default:
        return come_or_go();
    }
  }

  void check() const {
    ASSERT_EQ(slot_table_.violations(), 0u);
    ASSERT_EQ(slot_table_.acquired(), static_cast<int>(acquired_.size()));
    ASSERT_EQ(slot_table_.shut(), static_cast<int>(shut_.size()));
    for (const auto& [slot, number] : acquired_) {
      (void)number;
      ASSERT_EQ(table_[slot].word & 7, static_cast<uint32_t>(SlotState::Showing));
    }
  }

  [[nodiscard]] uint64_t pulled() const { return pulled_; }

 private:
  void take() {
    if (!connected_ || held_) return;
    const int start = static_cast<int>(random_() % table_.size());
    for (size_t i = 0; i < table_.size(); ++i) {
      const int slot = static_cast<int>((start + i) % table_.size());
      if (!take_free_slot(table_[slot], slot_table_.epoch())) continue;
      ASSERT_FALSE(acquired_.contains(slot)) << "a lent slot must not be written";
      ASSERT_FALSE(shut_.contains(slot)) << "a shut slot must not be written";
      held_ = slot;
      return;
    }
    slot_table_.slot_wanted();
  }

  void publish() {
    if (!held_) return;
    if (random_() % 8 == 0) {
      abandon_slot(table_[*held_], slot_table_.epoch());
    } else {
      number_ += 1 + random_() % 3;
      ASSERT_TRUE(publish_slot(table_[*held_], slot_table_.epoch(), number_, order_++));
      expected_.push_back({.end = false, .number = number_});
    }
    held_.reset();
  }

  void pull() {
    SlotTable::Frame frame;
    const PullStatus status = slot_table_.pull(frame);
    if (static_cast<int>(acquired_.size()) >= slot_table_.max_acquired() && !expected_.empty() &&
        !expected_.front().end) {
      ASSERT_EQ(status, PullStatus::NotYet) << "everything that may be lent is lent";
      return;
    }
    if (expected_.empty()) {
      ASSERT_EQ(status, finished_ ? PullStatus::End : PullStatus::NotYet);
      return;
    }
    const Expected next = expected_.front();
    ASSERT_EQ(status, next.end ? PullStatus::End : PullStatus::Ready);
    if (next.end) {
      expected_.pop_front();
      return;
    }
    ASSERT_EQ(frame.number, next.number);
    acquired_.emplace(frame.slot, frame.number);
    ++pulled_;
    expected_.pop_front();
  }

  void release() {
    if (acquired_.empty()) return;
    auto at = acquired_.begin();
    std::advance(at, random_() % acquired_.size());
    (void)slot_table_.release(at->first);
    acquired_.erase(at);
  }

  void come_or_go() {
    if (!connected_) return come();
    switch (random_() % 3) {
      case 0:
        return die(RendererFate::Dead);
      case 1:
        return die(RendererFate::MayLive);
      default:
        return say_goodbye();
    }
  }

  void come() {
    slot_table_.renew_offers();
    slot_table_.begin_connection({});
    connected_ = true;
    finished_ = false;
    order_ = 0;
    number_ = 0;
  }

  void die(RendererFate fate) {
    const Epoch epoch = slot_table_.epoch();
    const int newly_shut = slot_table_.end_connection(fate);
    ASSERT_EQ(newly_shut, fate == RendererFate::MayLive && held_ ? 1 : 0);
    if (newly_shut == 1) shut_.insert(*held_);
    held_.reset();
    connected_ = false;
    // The renderer dies for good sooner or later; a few stay.
    if (newly_shut == 1 && (shut_.size() > 1 || random_() % 2 == 0)) {
      slot_table_.recover(epoch);
      for (auto at = shut_.begin(); at != shut_.end();)
        at = table_[*at].word == slot_word(SlotState::Free, slot_table_.epoch()) ? shut_.erase(at)
                                                                                 : std::next(at);
    }
  }

  void say_goodbye() {
    if (held_) abandon_slot(table_[*held_], slot_table_.epoch());
    held_.reset();
    slot_table_.finish_sequence(order_);
    ASSERT_EQ(slot_table_.end_connection(RendererFate::MayLive), 0);
    connected_ = false;
    finished_ = true;
    expected_.push_back({.end = true});
  }

  std::vector<SlotEntry> table_;
  SlotTable slot_table_;
  std::mt19937 random_;
  std::deque<Expected> expected_;
  std::map<int, uint64_t> acquired_;
  std::set<int> shut_;
  std::optional<int> held_;
  bool connected_ = false;
  bool finished_ = false;
  uint64_t order_ = 0;
  uint64_t number_ = 0;
  uint64_t pulled_ = 0;
};

TEST(SlotTableModel, HandsOutTheSameFramesAsADeque) {
  for (const LoopKeeping keeping : {LoopKeeping::Off, LoopKeeping::On})
    for (const int slots : {3, 4, 7, 64})
      for (unsigned seed = 1; seed <= 10; ++seed) {
        SCOPED_TRACE(testing::Message() << slots << " slots, seed " << seed << ", keeping "
                                        << (keeping == LoopKeeping::On));
        History history(slots, keeping, seed);
        for (int step = 0; step < 10000; ++step) {
          history.step();
          history.check();
          if (testing::Test::HasFatalFailure()) return;
        }
        EXPECT_GT(history.pulled(), 100u) << "the history must get somewhere";
      }
}

/// Any sequence that fits is replayed exactly, any number of times and with any frames acquired
/// meanwhile.
TEST(SlotTableModel, RewindReplaysTheWholeSequence) {
  std::mt19937 random(5);
  for (int round = 0; round < 300; ++round) {
    const int slots = 3 + static_cast<int>(random() % 10);
    const int frames = 1 + static_cast<int>(random() % slots);
    std::vector<SlotEntry> table(static_cast<size_t>(slots));
    SlotTable slot_table(table, LoopKeeping::On);
    slot_table.begin_connection({});
    for (int k = 0; k < frames; ++k) {
      ASSERT_TRUE(take_free_slot(table[k], slot_table.epoch()));
      ASSERT_TRUE(publish_slot(table[k], slot_table.epoch(), k, k));
    }
    slot_table.finish_sequence(frames);
    ASSERT_EQ(slot_table.end_connection(RendererFate::Dead), 0);

    std::deque<int> acquired;  // the player keeps up to two frames, across the loop point
    for (int turn = 0; turn < 4; ++turn) {
      for (int k = 0; k < frames; ++k) {
        while (acquired.size() > random() % 2) {
          (void)slot_table.release(acquired.front());
          acquired.pop_front();
        }
        SlotTable::Frame frame;
        ASSERT_EQ(slot_table.pull(frame), PullStatus::Ready);
        ASSERT_EQ(frame.number, static_cast<uint64_t>(k));
        acquired.push_back(frame.slot);
      }
      SlotTable::Frame none;
      ASSERT_EQ(slot_table.pull(none), PullStatus::End);
      ASSERT_TRUE(slot_table.rewind());
    }
    ASSERT_EQ(slot_table.violations(), 0u);
  }
}

}  // namespace
}  // namespace lenticule::frames
