// SPDX-License-Identifier: Apache-2.0
#include "frames/ring/slot_table.h"

#include <utility>

#include "base/error.h"

namespace lenticule::frames {
namespace {

constexpr uint64_t kMaxFrameNumber = uint64_t{1} << 48;

}  // namespace

SlotTable::SlotTable(std::span<SlotEntry> table, LoopKeeping keeping)
    : table_(table),
      keeping_(keeping),
      slots_(table.size()),
      ready_(table.size()),
      loop_(keeping == LoopKeeping::On ? LoopState::Keeping : LoopState::Off) {
  kept_.reserve(table.size());
  for (int slot = 0; slot < static_cast<int>(table.size()); ++slot) offer(slot);
}

/// Counts a violation. The violator of an earlier renderer's slot need not be the present renderer.
void SlotTable::violated(Epoch by) noexcept {
  ++violations_;
  if (connected_ && by == epoch_) misbehaved_ = true;
}

// --- renderers ---------------------------------------------------------------------------------

void SlotTable::renew_offers() noexcept {
  LENTICULE_CHECK(!connected_);
  for (size_t slot = 0; slot < slots_.size(); ++slot)
    if (slots_[slot].owner == Owner::Renderer)
      table_[slot].word.store(slots_[slot].word, std::memory_order_release);
}

void SlotTable::begin_connection(std::optional<uint64_t> frame_count) noexcept {
  LENTICULE_CHECK(!connected_);
  if (finished_) begin_sequence();
  connected_ = true;
  misbehaved_ = false;
  next_order_ = 0;
  last_number_.reset();
  if (loop_ == LoopState::Keeping && frame_count.value_or(0) > slots_.size())
    stop_keeping(LoopState::TooLong);
}

void SlotTable::begin_sequence() noexcept {
  stop_keeping(keeping_ == LoopKeeping::On ? LoopState::Keeping : LoopState::Off);
  ++receiving_;
  finished_ = false;
}

int SlotTable::end_connection(RendererFate fate) noexcept {
  take_published();
  const Epoch old_epoch = std::exchange(epoch_, next_epoch(epoch_));
  const int shut_before = shut_;
  for (int slot = 0; slot < static_cast<int>(slots_.size()); ++slot)
    if (slots_[slot].owner == Owner::Renderer) withdraw(slot, old_epoch, fate);
  connected_ = false;
  misbehaved_ = false;
  return shut_ - shut_before;
}

/// Withdraws a slot. After the exchange either the renderer has the slot, or the new epoch's word
/// is in the table. The exchange decides also against a live renderer that tries to take the slot
/// at this moment.
void SlotTable::withdraw(int slot, Epoch old_epoch, RendererFate fate) noexcept {
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

void SlotTable::recover(Epoch epoch) noexcept {
  for (int slot = 0; slot < static_cast<int>(slots_.size()); ++slot) {
    if (slots_[slot].owner != Owner::None || slots_[slot].epoch != epoch) continue;
    --shut_;
    ++recovered_;
    offer(slot);
  }
}

void SlotTable::finish_sequence(uint64_t published) noexcept {
  take_published();
  if (!misbehaved_ && published != next_order_) violated(epoch_);
  finished_ = true;
}

void SlotTable::slot_wanted() noexcept {
  take_published();
  if (loop_ == LoopState::Keeping && !finished_ && offered_ == 0) stop_keeping(LoopState::TooLong);
}

void SlotTable::offer(int slot) noexcept {
  Slot& entry = slots_[slot];
  entry.owner = Owner::Renderer;
  entry.epoch = epoch_;
  entry.word = slot_word(SlotState::Free, epoch_);
  ++offered_;
  table_[slot].word.store(entry.word, std::memory_order_release);
}

bool SlotTable::offer_if_idle(int slot) noexcept {
  const Slot& entry = slots_[slot];
  if (entry.owner != Owner::Player || entry.queued || entry.kept || entry.acquired > 0)
    return false;
  offer(slot);
  return true;
}

void SlotTable::stop_keeping(LoopState reason) noexcept {
  loop_ = reason;
  for (const int slot : kept_) {
    slots_[slot].kept = false;
    offer_if_idle(slot);
  }
  kept_.clear();
}

// --- taking over -------------------------------------------------------------------------------

void SlotTable::take_published() noexcept {
  while (take_next()) {
  }
}

bool SlotTable::take_next() noexcept {
  if (!connected_ || misbehaved_) return false;
  int slot = 0;
  Search search = find_next_published(slot);
  // During the search the renderer may have published a frame in a slot already passed and the next
  // frame in a slot ahead. After the later frame was seen, a second search must find the earlier
  // one.
  if (search == Search::LaterOnly) search = find_next_published(slot);
  if (search == Search::LaterOnly || search == Search::Broken) violated(epoch_);
  if (search != Search::Found) return false;
  take_over(slot);
  return !misbehaved_;
}

SlotTable::Search SlotTable::find_next_published(int& found) noexcept {
  const int count = static_cast<int>(slots_.size());
  bool later = false;
  for (int i = 0; i < count; ++i) {
    const int slot = (cursor_ + i) % count;
    if (slots_[slot].owner != Owner::Renderer) continue;
    const uint32_t word = table_[slot].word.load(std::memory_order_acquire);
    if (word == slot_word(SlotState::Free, epoch_) || word == slot_word(SlotState::Writing, epoch_))
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

void SlotTable::take_over(int slot) noexcept {
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

// --- frames ------------------------------------------------------------------------------------

PullStatus SlotTable::pull(Frame& out) noexcept {
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

void SlotTable::acquire(Frame& out) noexcept {
  const int slot = ready_.front();
  Slot& entry = slots_[slot];
  ready_.pop();
  entry.queued = false;
  if (entry.acquired++ == 0) set_word(slot, SlotState::Showing);
  ++acquired_;
  out = {.slot = slot, .number = entry.number};
}

/// Sets the state of a slot that the player owns: no other process may have changed the word
/// meanwhile.
void SlotTable::set_word(int slot, SlotState state) noexcept {
  Slot& entry = slots_[slot];
  const uint32_t word = slot_word(state, entry.epoch);
  if (table_[slot].word.exchange(word, std::memory_order_acq_rel) != entry.word)
    violated(entry.epoch);
  entry.word = word;
}

bool SlotTable::release(int slot) noexcept {
  LENTICULE_CHECK(slot >= 0 && slot < static_cast<int>(slots_.size()) && slots_[slot].acquired > 0);
  --acquired_;
  if (--slots_[slot].acquired > 0) return false;
  set_word(slot, SlotState::Ready);
  return offer_if_idle(slot);
}

bool SlotTable::rewind() noexcept {
  const bool complete = finished_ && pulling_ == receiving_ && ready_.empty();
  if (loop_ != LoopState::Keeping || !complete || kept_.empty()) return false;
  for (const int slot : kept_) {
    slots_[slot].queued = true;
    ready_.push(slot);
  }
  end_reported_ = false;
  return true;
}

std::string SlotTable::loop_obstacle() const {
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

}  // namespace lenticule::frames
