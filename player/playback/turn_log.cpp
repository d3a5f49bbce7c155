// SPDX-License-Identifier: Apache-2.0
#include "player/playback/turn_log.h"

namespace lenticule::player {
namespace {

uint64_t missed_of(const PaceCounts& counts) noexcept {
  return counts.missed + counts.repeated_underrun + counts.dropped;
}

uint64_t left_out_of(const PaceCounts& counts) noexcept {
  return counts.dropped + counts.skipped_planned;
}

}  // namespace

void TurnLog::count(ItemTurn& turn, const PaceCounts& counts) const noexcept {
  turn.missed = missed_of(counts) - missed_of(at_begin_);
  turn.left_out = left_out_of(counts) - left_out_of(at_begin_);
}

void TurnLog::flipped(const Flip& flip, const PaceCounts& counts) noexcept {
  const auto time_ns = static_cast<uint64_t>(flip.time.count());
  const bool begins = turn_.turn == 0 || flip.item != turn_.item;
  if (begins) {
    end(time_ns, counts, flip.cut != cut_);
    turn_ = {.turn = ++turns_, .item = flip.item, .begun_ns = time_ns};
    at_begin_ = counts;
  } else if (flip.number < last_number_) {
    ++turn_.rounds;
  }
  cut_ = flip.cut;
  last_number_ = flip.number;
  ++turn_.frames;
  turn_.ended_ns = time_ns;
  count(turn_, counts);
  running_.publish(turn_);
  if (begins) changed_.signal();
}

void TurnLog::finish(display::Nanoseconds time, const PaceCounts& counts) noexcept {
  end(static_cast<uint64_t>(time.count()), counts, true);
  turn_ = {};
  running_.publish(turn_);
  changed_.signal();
}

void TurnLog::end(uint64_t time_ns, const PaceCounts& counts, bool cut) noexcept {
  if (turn_.turn == 0) return;
  count(turn_, counts);
  turn_.ended_ns = time_ns;
  turn_.cut = cut ? 1 : 0;
  const uint64_t ended = ended_count_.load(std::memory_order_relaxed);
  ended_[ended % kKept].publish(turn_);
  ended_count_.store(ended + 1, std::memory_order_release);
}

std::optional<ItemTurn> TurnLog::take() noexcept {
  changed_.drain();
  while (true) {
    const uint64_t ended = ended_count_.load(std::memory_order_acquire);
    if (taken_ == ended) return std::nullopt;
    if (ended - taken_ > kKept) {
      lost_ += ended - kKept - taken_;
      taken_ = ended - kKept;
    }
    const ItemTurn turn = ended_[taken_ % kKept].read();
    ++taken_;
    if (turn.turn == taken_) return turn;
    ++lost_;  // overwritten meanwhile
  }
}

}  // namespace lenticule::player
