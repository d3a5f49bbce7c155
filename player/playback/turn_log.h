// SPDX-License-Identifier: Apache-2.0
// TurnLog records the turns of the items on the display, for the proof of play. The presenter
// writes it at flips, without a lock; one other thread takes the turns that have ended.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "base/live_value.h"
#include "base/wake_fd.h"
#include "display/clock.h"
#include "player/playback/pacing.h"

namespace lenticule::player {

/// ItemTurn is the time from the flip of an item's first frame to that of the next item's.
struct ItemTurn {
  uint64_t turn = 0;      ///< counts the turns of a playback from 1; 0: none
  uint64_t item = 0;      ///< item number that the source gives
  uint64_t frames = 0;    ///< frames that appeared
  uint64_t rounds = 0;    ///< times that the item began again
  uint64_t missed = 0;    ///< vblanks without the frame that was due, and late frames left out
  uint64_t left_out = 0;  ///< frames left out because they were late or as planned
  uint64_t begun_ns = 0;  ///< display clock
  uint64_t ended_ns = 0;  ///< time of the last flip while the turn goes on
  uint64_t cut = 0;       ///< 1: a jump or the end of the playback ended the turn
  friend bool operator==(const ItemTurn&, const ItemTurn&) = default;
};

/// Thread safety: flipped() and finish() on the presenter's thread, the rest on one other thread.
class TurnLog {
 public:
  /// Number of ended turns that are kept until they are taken.
  static constexpr size_t kKept = 64;

  struct Flip {
    uint64_t item = 0;
    uint64_t number = 0;  ///< frame number within the item
    uint64_t cut = 0;     ///< discontinuity number of the source
    display::Nanoseconds time{0};
  };
  /// Records a frame that appeared. `counts` include its flip.
  void flipped(const Flip& flip, const PaceCounts& counts) noexcept;
  /// Ends the running turn: the playback is over.
  void finish(display::Nanoseconds time, const PaceCounts& counts) noexcept;

  /// Returns a descriptor that is readable when a turn has begun or ended; take() clears it.
  [[nodiscard]] int fd() const noexcept { return changed_.fd(); }
  /// Returns the oldest ended turn that was not taken yet.
  [[nodiscard]] std::optional<ItemTurn> take() noexcept;
  /// Returns the turn that goes on; its number is 0 if there is none, or if turns that ended before
  /// were not taken yet.
  [[nodiscard]] ItemTurn running() const noexcept {
    const ItemTurn turn = running_.read();
    return turn.turn == taken_ + 1 ? turn : ItemTurn{};
  }
  /// Returns the number of turns that ended and were overwritten before they were taken.
  [[nodiscard]] uint64_t lost() const noexcept { return lost_; }

 private:
  void end(uint64_t time_ns, const PaceCounts& counts, bool cut) noexcept;
  void count(ItemTurn& turn, const PaceCounts& counts) const noexcept;

  // The presenter's members.
  ItemTurn turn_;
  PaceCounts at_begin_;
  uint64_t turns_ = 0;
  uint64_t cut_ = 0;
  uint64_t last_number_ = 0;

  LiveValue<ItemTurn> running_;
  std::array<LiveValue<ItemTurn>, kKept> ended_;
  std::atomic<uint64_t> ended_count_{0};
  WakeFd changed_;

  // The reader's members.
  uint64_t taken_ = 0;
  uint64_t lost_ = 0;
};

}  // namespace lenticule::player
