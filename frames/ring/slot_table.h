// SPDX-License-Identifier: Apache-2.0
// SlotTable is the player's private slot table. It reads each value of the shared table once,
// checks the value against its own records, and never lets the shared table override them.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "frames/frame_source.h"
#include "frames/ring/ring_layout.h"

namespace lenticule::frames {

enum class LoopKeeping {
  Off,  ///< a shown slot is free again
  On,   ///< slots keep their frames as long as the sequence fits the ring
};

/// RendererFate is the state of a renderer whose connection has ended.
enum class RendererFate {
  Dead,     ///< the process has exited and cannot write any more
  MayLive,  ///< the process may still be writing into the slot that it had taken
};

/// SlotTable tracks slots, sequences and epochs; sockets, files and processes are outside of its
/// scope. Allocates at construction only.
///
/// Thread safety: one thread.
class SlotTable {
 public:
  struct Frame {
    int slot = 0;
    uint64_t number = 0;
  };

  /// Offers every slot of `table`.
  ///
  /// Lifetime: `table` must outlive this object.
  SlotTable(std::span<SlotEntry> table, LoopKeeping keeping)
      : table_(table),
        keeping_(keeping),
        slots_(table.size()),
        ready_(table.size()),
        loop_(keeping == LoopKeeping::On ? LoopState::Keeping : LoopState::Off) {
    kept_.reserve(table.size());
    for (int slot = 0; slot < static_cast<int>(table.size()); ++slot) offer(slot);
  }

  // The functions below follow the connections of renderers.
  /// Returns the epoch of the connected renderer, or of the next one.
  [[nodiscard]] Epoch epoch() const { return epoch_; }
  /// Rewrites the words of the offered slots. Called between two connections.
  void renew_offers() noexcept {
    LENTICULE_CHECK(!connected_);
    for (size_t slot = 0; slot < slots_.size(); ++slot)
      if (slots_[slot].owner == Owner::Renderer)
        table_[slot].word.store(slots_[slot].word, std::memory_order_release);
  }
  void begin_connection(std::optional<uint64_t> frame_count) noexcept {
    LENTICULE_CHECK(!connected_);
    if (finished_) begin_sequence();
    connected_ = true;
    misbehaved_ = false;
    next_order_ = 0;
    last_number_.reset();
    if (loop_ == LoopState::Keeping && frame_count.value_or(0) > slots_.size())
      stop_keeping(LoopState::TooLong);
  }
  /// Takes over the frames that the renderer had published, then withdraws its slots. Returns the
  /// number of slots that stay shut until recover(), because the renderer may still be writing
  /// there.
  int end_connection(RendererFate fate) noexcept {
    take_published();
    const Epoch old_epoch = std::exchange(epoch_, next_epoch(epoch_));
    const int shut_before = shut_;
    for (int slot = 0; slot < static_cast<int>(slots_.size()); ++slot)
      if (slots_[slot].owner == Owner::Renderer) withdraw(slot, old_epoch, fate);
    connected_ = false;
    misbehaved_ = false;
    return shut_ - shut_before;
  }
  /// Offers the shut slots of the renderer of `epoch` again, after its death.
  void recover(Epoch epoch) noexcept {
    for (int slot = 0; slot < static_cast<int>(slots_.size()); ++slot) {
      if (slots_[slot].owner != Owner::None || slots_[slot].epoch != epoch) continue;
      --shut_;
      ++recovered_;
      offer(slot);
    }
  }
  /// Records the renderer's report that its `published` frames complete the sequence.
  void finish_sequence(uint64_t published) noexcept {
    take_published();
    if (!misbehaved_ && published != next_order_) violated(epoch_);
    finished_ = true;
  }
  /// Records that the renderer waits for a slot: a ring that is full of kept frames stops keeping
  /// them.
  void slot_wanted() noexcept {
    take_published();
    if (loop_ == LoopState::Keeping && !finished_ && offered_ == 0)
      stop_keeping(LoopState::TooLong);
  }
  /// Takes over the frames published since the last call.
  void take_published() noexcept {
    while (take_next()) {
    }
  }
  /// Returns true if the connected renderer violated the protocol and must be disconnected.
  [[nodiscard]] bool misbehaved() const { return misbehaved_; }

  // The functions below hand out frames and take them back; see FrameSource.
  [[nodiscard]] PullStatus pull(Frame& out) noexcept {
    take_published();
    for (;;) {
      if (!ready_.empty() && slots_[ready_.front()].sequence == pulling_) {
        if (acquired_ >= max_acquired()) return PullStatus::NotYet;
        acquire(out);
        return PullStatus::Ready;
      }
      const bool next_has_begun = pulling_ < receiving_;
      if (!next_has_begun && !finished_) return PullStatus::NotYet;
      if (!next_has_begun) {
        end_reported_ = true;
        return PullStatus::End;
      }
      ++pulling_;
      if (!std::exchange(end_reported_, false)) return PullStatus::End;
    }
  }
  /// Returns true if the slot is free for the renderer again.
  bool release(int slot) noexcept {
    LENTICULE_CHECK(slot >= 0 && slot < static_cast<int>(slots_.size()) &&
                    slots_[slot].acquired > 0);
    --acquired_;
    if (--slots_[slot].acquired > 0) return false;
    set_word(slot, SlotState::Ready);
    return offer_if_idle(slot);
  }
  [[nodiscard]] bool rewind() noexcept {
    const bool complete = finished_ && pulling_ == receiving_ && ready_.empty();
    if (loop_ != LoopState::Keeping || !complete || kept_.empty()) return false;
    for (const int slot : kept_) {
      slots_[slot].queued = true;
      ready_.push(slot);
    }
    end_reported_ = false;
    return true;
  }
  [[nodiscard]] uint64_t ready_count() const { return ready_.size(); }
  [[nodiscard]] bool saturated() const { return finished_ || offered_ == 0; }
  /// Returns the number of the last frame that the present or the last renderer published.
  [[nodiscard]] std::optional<uint64_t> last_number() const { return last_number_; }
  [[nodiscard]] int max_acquired() const { return static_cast<int>(slots_.size()) - 1; }

  // Statistics.
  [[nodiscard]] uint64_t accepted() const { return accepted_; }
  [[nodiscard]] uint64_t recovered() const { return recovered_; }
  [[nodiscard]] uint64_t violations() const { return violations_; }
  [[nodiscard]] int shut() const { return shut_; }
  [[nodiscard]] int acquired() const { return acquired_; }
  /// Returns the reason why rewind() cannot replay the present sequence; empty while it can (or may
  /// later).
  [[nodiscard]] std::string loop_obstacle() const {
    switch (loop_) {
      case LoopState::Keeping:
        return {};
      case LoopState::Off:
        return "the ring was opened without keeping its frames for a loop";
      case LoopState::TooLong:
        return "the sequence has more frames than the ring's " + std::to_string(slots_.size()) +
               " slots";
    }
    return {};
  }

 private:
  static constexpr uint64_t kMaxFrameNumber = uint64_t{1} << 48;
  enum class Owner : uint8_t {
    Renderer,  ///< offered: free, being written, or published and not yet taken over
    Player,    ///< taken over: the frame belongs to the player until the slot is offered again
    None,      ///< shut: an earlier renderer may still be writing
  };
  struct Slot {
    Owner owner = Owner::Renderer;
    bool queued = false;  ///< waits in ready_
    bool kept = false;    ///< stays for rewind()
    int acquired = 0;   ///< number of acquisitions: a rewound frame can be acquired again while it
                        ///< is still displayed
    uint32_t word = 0;  ///< value that the player last wrote to the table
    Epoch epoch = 0;    ///< epoch of the renderer that the slot was offered to
    uint64_t number = 0;
    uint64_t sequence = 0;
  };
  /// Queue is a FIFO of slots that never contains a slot twice.
  class Queue {
   public:
    explicit Queue(size_t capacity) : slots_(capacity) {}
    [[nodiscard]] bool empty() const { return size_ == 0; }
    [[nodiscard]] size_t size() const { return size_; }
    [[nodiscard]] int front() const { return slots_[head_]; }
    void push(int slot) { slots_[(head_ + size_++) % slots_.size()] = slot; }
    void pop() {
      head_ = (head_ + 1) % slots_.size();
      --size_;
    }

   private:
    std::vector<int> slots_;
    size_t head_ = 0;
    size_t size_ = 0;
  };
  enum class Search { Found, NothingNew, LaterOnly, Broken };
  enum class LoopState { Off, Keeping, TooLong };

  /// Counts a violation. The violator of an earlier renderer's slot need not be the present
  /// renderer.
  void violated(Epoch by) noexcept {
    ++violations_;
    if (connected_ && by == epoch_) misbehaved_ = true;
  }
  [[nodiscard]] Search find_next_published(int& found) noexcept {
    const int count = static_cast<int>(slots_.size());
    bool later = false;
    for (int i = 0; i < count; ++i) {
      const int slot = (cursor_ + i) % count;
      if (slots_[slot].owner != Owner::Renderer) continue;
      const uint32_t word = table_[slot].word.load(std::memory_order_acquire);
      if (word == slot_word(SlotState::Free, epoch_) ||
          word == slot_word(SlotState::Writing, epoch_))
        continue;
      if (word != slot_word(SlotState::Ready, epoch_)) return Search::Broken;
      const uint64_t order = table_[slot].order.load(std::memory_order_relaxed);
      if (order < next_order_) return Search::Broken;
      if (order == next_order_) {
        found = slot;
        return Search::Found;
      }
      later = true;
    }
    return later ? Search::LaterOnly : Search::NothingNew;
  }
  [[nodiscard]] bool take_next() noexcept {
    if (!connected_ || misbehaved_) return false;
    int slot = 0;
    Search search = find_next_published(slot);
    // During the search the renderer may have published a frame in a slot already passed and the
    // next frame in a slot ahead. After the later frame was seen, a second search must find the
    // earlier one.
    if (search == Search::LaterOnly) search = find_next_published(slot);
    if (search == Search::LaterOnly || search == Search::Broken) violated(epoch_);
    if (search != Search::Found) return false;
    take_over(slot);
    return !misbehaved_;
  }
  void take_over(int slot) noexcept {
    const uint64_t number = table_[slot].frame_number.load(std::memory_order_relaxed);
    if (number > kMaxFrameNumber || (last_number_ && number <= *last_number_)) {
      violated(epoch_);
      return;
    }
    last_number_ = number;
    ++next_order_;
    ++accepted_;
    cursor_ = (slot + 1) % static_cast<int>(slots_.size());

    Slot& entry = slots_[slot];
    entry.owner = Owner::Player;
    --offered_;
    entry.word = slot_word(SlotState::Ready, epoch_);
    entry.number = number;
    entry.sequence = receiving_;
    entry.queued = true;
    ready_.push(slot);
    if (loop_ == LoopState::Keeping) {
      entry.kept = true;
      kept_.push_back(slot);
    }
  }
  /// Withdraws a slot. After the exchange either the renderer has the slot, or the new epoch's word
  /// is in the table. The exchange decides also against a live renderer that tries to take the slot
  /// at this moment.
  void withdraw(int slot, Epoch old_epoch, RendererFate fate) noexcept {
    uint32_t word = slot_word(SlotState::Free, old_epoch);
    const uint32_t renewed = slot_word(SlotState::Free, epoch_);
    --offered_;
    if (table_[slot].word.compare_exchange_strong(word, renewed, std::memory_order_acq_rel)) {
      offer(slot);
      return;
    }
    const bool was_published = word == slot_word(SlotState::Ready, old_epoch);
    if (fate == RendererFate::Dead || was_published) {
      ++recovered_;
      offer(slot);
      return;
    }
    slots_[slot].owner = Owner::None;
    ++shut_;
  }
  void offer(int slot) noexcept {
    Slot& entry = slots_[slot];
    entry.owner = Owner::Renderer;
    entry.epoch = epoch_;
    entry.word = slot_word(SlotState::Free, epoch_);
    ++offered_;
    table_[slot].word.store(entry.word, std::memory_order_release);
  }
  bool offer_if_idle(int slot) noexcept {
    const Slot& entry = slots_[slot];
    if (entry.owner != Owner::Player || entry.queued || entry.kept || entry.acquired > 0)
      return false;
    offer(slot);
    return true;
  }
  /// Sets the state of a slot that the player owns: no other process may have changed the word
  /// meanwhile.
  void set_word(int slot, SlotState state) noexcept {
    Slot& entry = slots_[slot];
    const uint32_t word = slot_word(state, entry.epoch);
    if (table_[slot].word.exchange(word, std::memory_order_acq_rel) != entry.word)
      violated(entry.epoch);
    entry.word = word;
  }
  void begin_sequence() noexcept {
    stop_keeping(keeping_ == LoopKeeping::On ? LoopState::Keeping : LoopState::Off);
    ++receiving_;
    finished_ = false;
  }
  void stop_keeping(LoopState reason) noexcept {
    loop_ = reason;
    for (const int slot : kept_) {
      slots_[slot].kept = false;
      offer_if_idle(slot);
    }
    kept_.clear();
  }
  void acquire(Frame& out) noexcept {
    const int slot = ready_.front();
    Slot& entry = slots_[slot];
    ready_.pop();
    entry.queued = false;
    if (entry.acquired++ == 0) set_word(slot, SlotState::Showing);
    ++acquired_;
    out = {.slot = slot, .number = entry.number};
  }

  std::span<SlotEntry> table_;
  LoopKeeping keeping_;
  std::vector<Slot> slots_;
  Queue ready_;
  std::vector<int> kept_;  ///< slots of the present sequence in order

  Epoch epoch_ = 1;
  bool connected_ = false;
  bool misbehaved_ = false;
  uint64_t next_order_ = 0;
  std::optional<uint64_t> last_number_;
  int cursor_ = 0;  ///< next slot to examine: correct renderers use the slots in cyclic order

  uint64_t receiving_ = 0;  ///< number of the sequence that renderers deliver
  uint64_t pulling_ = 0;    ///< number of the sequence that pull() returns
  bool finished_ = false;   ///< receiving_ is complete
  bool end_reported_ = false;
  LoopState loop_;

  int offered_ = 0;
  int shut_ = 0;
  int acquired_ = 0;
  uint64_t accepted_ = 0;
  uint64_t recovered_ = 0;
  uint64_t violations_ = 0;
};

}  // namespace lenticule::frames
