// SPDX-License-Identifier: Apache-2.0
// PlaylistReporter keeps the status of a playlist, and passes its events and faults on.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "base/error.h"
#include "player/playlist/open_item.h"

namespace lenticule::player {

struct PlaylistEvent {
  enum class Kind {
    ItemStarted,  ///< its first frame was taken; the panel shows it a few frames
                  ///< later
    LoopPoint,    ///< loop point: the item begins again without a gap
    ItemSkipped,  ///< the item cannot be played, or not any further
    Replaced,     ///< the list, or the item's file, was replaced and is played from
                  ///< now on
    Kept,         ///< a replacement cannot be played: the old content continues
    Returned,     ///< the item continues after an interruption
    Waiting,      ///< no item of the list can begin, for the reason in `detail`
    ItemDamaged,  ///< the item was played, but some of its frames were damaged,
                  ///< missing or repeated
  };
  Kind kind = Kind::ItemStarted;
  std::string source{};
  std::string detail{};  ///< reason for ItemSkipped, Waiting or Kept; files of a folder (Replaced)
  bool woven_elsewhere = false;  ///< ItemStarted, Returned: OpenedSource::woven_elsewhere
};

/// Returns the error with its remedy in one line, as a reason for ItemSkipped.
[[nodiscard]] std::string with_remedy(const Error& error);

/// A snapshot of the playlist's state.
struct PlaylistStatus {
  std::string list;
  std::string source;  ///< source that frames are taken from; empty if none
  std::optional<size_t> item{};
  size_t items = 0;
  std::optional<uint64_t> frames{};  ///< frames in one round of the item, if known
  uint64_t rounds_done = 0;
  uint64_t started = 0;
  uint64_t loop_points = 0;
  uint64_t loops = 0;  ///< times that an item was complete
  uint64_t skipped = 0;
  std::string last_problem{};    ///< empty again once the content that caused it plays
  std::string waiting_for{};     ///< why no item of the list can begin; empty if one plays
  frames::FrameDamage damage{};  ///< total over all items so far
  /// The damaged items, by source.
  std::map<std::string, frames::FrameDamage> damaged_items{};
  bool opening = false;       ///< the target of a jump is being opened
  std::string cued{};         ///< source of the cued item; empty if none
  std::string interrupted{};  ///< source that continues after the interruption; empty without one
};

/// ItemAccount is what the playlist knows about an item's turn.
struct ItemAccount {
  uint32_t number = 0;  ///< running number of the item
  SourceSpec source{};
  std::optional<size_t> index{};  ///< place in the list
  bool from_start = true;         ///< the turn began with the item's first frame
  bool to_end = false;            ///< all frames of the turn were handed out; no jump ended it
  uint64_t handed_out = 0;        ///< frames, known at the end of the turn
  frames::FrameDamage damage{};
};

/// Thread safety: any thread. Events are sent on the thread that reports them, without a lock.
class PlaylistReporter {
 public:
  using OnEvent = std::function<void(const PlaylistEvent&)>;

  /// `on_event` may be null.
  PlaylistReporter(const Playlist& list, OnEvent on_event);

  /// Passes the event on, and counts it.
  void report(const PlaylistEvent& event);
  /// Reports that frames are taken from the item from now on.
  void begin(const OpenItem& item);
  /// Reports the first frame of an item.
  void started(const OpenItem& item);
  /// Reports that a round of the item is complete.
  void loop_done(const OpenItem& item);
  /// Notes why no item of the list can begin. Returns true if that is new; then report it without a
  /// lock.
  [[nodiscard]] bool note_waiting(const std::string& why);
  /// Adds the damage that the item's source found since the last call.
  void count_damage(OpenItem& item);
  /// Reports the whole damage of an item that ends.
  void report_damage(const OpenItem& item);
  /// Reports that no more frames of the item are handed out.
  void end(const OpenItem& item, bool to_end);
  /// Reports the size of a new list, and the place of the playing item in it. A problem of the
  /// replaced list is over.
  void take_list(size_t items, std::optional<size_t> playing);

  [[nodiscard]] PlaylistStatus status() const;
  [[nodiscard]] frames::FrameDamage damage() const;
  /// Returns the item's account, if it is remembered.
  [[nodiscard]] std::optional<ItemAccount> account_of(uint32_t number) const;

 private:
  [[nodiscard]] ItemAccount* locked_account(uint32_t number);
  void locked_played_whole(const OpenItem& item);

  const OnEvent on_event_;
  mutable std::mutex mutex_;  ///< guards the members below; no other lock is taken under it
  PlaylistStatus status_;
  PlaylistEvent problem_;  ///< event of status_.last_problem
  std::deque<ItemAccount> begun_;
};

}  // namespace lenticule::player
