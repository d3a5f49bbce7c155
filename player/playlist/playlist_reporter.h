// SPDX-License-Identifier: Apache-2.0
// PlaylistReporter keeps the status of a playlist, and passes its events and faults on.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "base/error.h"
#include "player/playback/play_statistics.h"
#include "player/playlist/open_item.h"

namespace lenticule::player {

struct PlaylistEvent {
  enum class Kind {
    ItemStarted,  ///< its first frame was taken; the panel shows it a few frames later
    LoopPoint,    ///< the item begins again without a gap
    ItemSkipped,  ///< the item cannot be played, or not any further
    Replaced,     ///< the list, or the item's file, was replaced and is played from now on
    Kept,         ///< a replacement cannot be played: the old content continues
    Returned,     ///< the item continues after an interruption
    Waiting,      ///< no item of the list can begin, for the reason in `detail`
    Still,        ///< the film has a single frame, which stays as a picture does
    ItemDamaged,  ///< it was played; some of its frames were damaged, missing or repeated
    BadOverlay,   ///< an overlay of the item cannot be drawn
  };
  Kind kind = Kind::ItemStarted;
  std::string source{};
  std::string detail{};  ///< reason for ItemSkipped, Waiting or Kept; files of a folder (Replaced)
  bool woven_elsewhere = false;  ///< ItemStarted, Returned: OpenedSource::woven_elsewhere
};

/// Returns the error with its remedy in one line, as a reason for ItemSkipped.
[[nodiscard]] inline std::string with_remedy(const Error& error) {
  return error.hint().empty() ? error.what() : std::string(error.what()) + "; " + error.hint();
}

/// A snapshot of the playlist's state.
struct PlaylistStatus {
  std::string list;
  std::string source;  ///< source that frames are taken from; empty if none
  std::optional<size_t> item{};
  size_t items = 0;
  std::optional<uint64_t> frames{};  ///< frames in one round of the item, if known
  int64_t rounds_done = 0;
  uint64_t started = 0;
  uint64_t loop_points = 0;
  uint64_t loops = 0;            ///< times that an item was complete
  uint64_t skipped = 0;          ///< items that could not be played, each counted once
  std::string last_problem{};    ///< empty again once the content that caused it plays
  PlayState state{};             ///< why no item of the list plays
  frames::FrameDamage damage{};  ///< total over all items so far
  /// The damaged items, by source.
  std::map<std::string, frames::FrameDamage> damaged_items{};
  std::shared_ptr<const CaptureStatistics> live{};  ///< figures of a live item, else null
  bool opening = false;                             ///< the target of a jump is being opened
  std::string cued{};                               ///< source of the cued item; empty if none
  std::string interrupted{};  ///< source that continues after the interruption; empty without one
  std::vector<std::string> overlays{};  ///< words of those over the frame that was taken last
};

struct SoundAccount {
  uint64_t heard_ms = 0;
  uint64_t silent_ms = 0;  ///< due, and not heard: no device, a stalled or damaged source
  std::string device{};    ///< the present one; empty: none
};

/// ItemAccount is what the playlist knows about an item's turn.
struct ItemAccount {
  uint32_t number = 0;  ///< running number of the item
  SourceSpec source{};
  std::optional<size_t> index{};  ///< place in the list
  int64_t rounds_done = 0;        ///< rounds of the list before this one
  bool from_start = true;         ///< the turn began with the item's first frame
  bool to_end = false;            ///< all frames of the turn were handed out; no jump ended it
  uint64_t handed_out = 0;        ///< frames, known at the end of the turn
  frames::FrameDamage damage{};
  std::optional<SoundAccount> sound{};  ///< none: the item has no sound
  std::vector<std::string> overlays{};  ///< words of those that frames of the turn had
};

/// Thread safety: any thread. Events are sent on the thread that reports them, without a lock.
class PlaylistReporter {
 public:
  using OnEvent = std::function<void(const PlaylistEvent&)>;

  /// `on_event` may be null.
  PlaylistReporter(const Playlist& list, OnEvent on_event) : on_event_(std::move(on_event)) {
    status_.list = list.name;
    status_.items = list.items.size();
  }

  /// Counts and passes on the event, unless an item is skipped again before another one begins.
  void report(const PlaylistEvent& event) {
    {
      const std::lock_guard lock(mutex_);
      if (event.kind == EventKind::ItemSkipped) {
        if (skipped_.size() >= kMostSkippedItems) skipped_.clear();
        const auto [at, is_new] = skipped_.try_emplace(event.source);
        status_.skipped += is_new ? 1 : 0;
        const std::pair report{status_.started, event.detail};
        if (std::exchange(at->second, report) == report) return;
      }
      const bool is_problem = event.kind == EventKind::ItemSkipped || event.kind == EventKind::Kept;
      const bool is_replaced = event.kind == EventKind::Replaced &&
                               problem_.kind == EventKind::Kept && problem_.source == event.source;
      if (is_replaced) status_.last_problem.clear();
      if (is_problem) {
        status_.last_problem = event.detail;
        problem_ = event;
      }
      if (event.kind == EventKind::LoopPoint) ++status_.loop_points;
    }
    if (on_event_) on_event_(event);
  }
  /// Reports that frames are taken from the item from now on.
  void begin(const OpenItem& item) {
    const std::lock_guard lock(mutex_);
    // A problem of another list is over, unless that list continues after an interruption.
    const bool is_other_list = status_.list != item.list->name && !item.interrupts && !item.returns;
    // An item that is opened anew is no longer its copy of before a change of the file.
    const bool is_opened_anew = problem_.kind == EventKind::Kept &&
                                problem_.source == item.item.source.text && !item.returns;
    if (is_other_list || is_opened_anew) status_.last_problem.clear();
    status_.list = item.list->name;
    status_.items = item.list->items.size();
    status_.source = item.item.source.text;
    status_.live = item.opened.live;
    const auto index = item.interrupts ? std::nullopt : item.index;
    status_.item = index;
    status_.frames = item.opened.source->frame_count();
    status_.rounds_done = std::max<int64_t>(item.rounds_done, 0);
    begun_.push_back({.number = item.number,
                      .source = item.item.source,
                      .index = index,
                      .rounds_done = item.rounds_done,
                      .from_start = item.first_frame == 0 && !item.returns});
    if (begun_.size() > kRememberedItems) begun_.pop_front();
  }
  /// Reports the first frame of an item.
  void started(const OpenItem& item) {
    {
      const std::lock_guard lock(mutex_);
      ++status_.started;
      if (item.index) status_.state = {};
    }
    report({.kind = EventKind::ItemStarted,
            .source = item.item.source.text,
            .woven_elsewhere = item.opened.woven_elsewhere});
  }
  /// Reports that a round of the item is complete.
  void loop_done(const OpenItem& item) {
    const std::lock_guard lock(mutex_);
    ++status_.loops;
    locked_played_whole(item);
  }
  /// Notes why no item of the list can begin. Returns true if that is new; then report it without a
  /// lock.
  [[nodiscard]] bool note_waiting(const PlayState& why) {
    const std::lock_guard lock(mutex_);
    return std::exchange(status_.state, why) != why;
  }
  /// Adds the damage that the item's source found since the last call.
  void count_damage(OpenItem& item) {
    const frames::FrameDamage now = item.opened.source->damage();
    const frames::FrameDamage before = std::exchange(item.damage, now);
    if (now == before) return;
    const frames::FrameDamage more{.damaged = now.damaged - before.damaged,
                                   .missing = now.missing - before.missing,
                                   .repeated = now.repeated - before.repeated};
    const std::string& source = item.item.source.text;
    const std::lock_guard lock(mutex_);
    status_.damage += more;
    const bool known = status_.damaged_items.contains(source);
    if (known || status_.damaged_items.size() < kMostDamagedItems)
      status_.damaged_items[source] += more;
    if (ItemAccount* const account = locked_account(item.number)) account->damage += more;
  }
  /// Reports the whole damage of an item that ends.
  void report_damage(const OpenItem& item) {
    if (item.damage.any())
      report({.kind = EventKind::ItemDamaged,
              .source = item.item.source.text,
              .detail = damage_text(item.damage)});
  }
  /// Reports that no more frames of the item are handed out.
  void end(const OpenItem& item, bool to_end) {
    const std::lock_guard lock(mutex_);
    if (to_end && item.handed_out > 0) locked_played_whole(item);
    ItemAccount* const account = locked_account(item.number);
    if (account == nullptr) return;
    account->to_end = to_end;
    account->handed_out = item.handed_out;
  }
  /// Notes the words of the overlays that frames of the item have from now on.
  void note_overlays(uint32_t number, std::vector<std::string> words) {
    const std::lock_guard lock(mutex_);
    ItemAccount* const account = locked_account(number);
    for (const std::string& one : words)
      if (account != nullptr && account->overlays.size() < kMostOverlays &&
          std::ranges::find(account->overlays, one) == account->overlays.end())
        account->overlays.push_back(one);
    status_.overlays = std::move(words);
  }
  /// Reports the size of a new list, and the place of the playing item in it. A problem of the
  /// replaced list is over.
  void take_list(size_t items, std::optional<size_t> playing) {
    const std::lock_guard lock(mutex_);
    status_.items = items;
    status_.item = playing;
    status_.last_problem.clear();
  }

  [[nodiscard]] PlaylistStatus status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }
  [[nodiscard]] frames::FrameDamage damage() const {
    const std::lock_guard lock(mutex_);
    return status_.damage;
  }
  /// Returns the item's account, if it is remembered.
  [[nodiscard]] std::optional<ItemAccount> account_of(uint32_t number) const {
    const std::lock_guard lock(mutex_);
    const auto account = std::ranges::find(begun_, number, &ItemAccount::number);
    return account == begun_.end() ? std::nullopt : std::optional(*account);
  }

 private:
  using EventKind = PlaylistEvent::Kind;
  static constexpr size_t kRememberedItems = 64;
  static constexpr size_t kMostDamagedItems = 1000, kMostSkippedItems = 1000, kMostOverlays = 32;
  [[nodiscard]] ItemAccount* locked_account(uint32_t number) {
    const auto account = std::ranges::find(begun_, number, &ItemAccount::number);
    return account == begun_.end() ? nullptr : &*account;
  }
  /// Ends the problem of an item that was left out before, and now played without a break.
  void locked_played_whole(const OpenItem& item) {
    if (problem_.kind == EventKind::ItemSkipped && problem_.source == item.item.source.text)
      status_.last_problem.clear();
  }

  const OnEvent on_event_;
  mutable std::mutex mutex_;  ///< guards the members below; no other lock is taken under it
  PlaylistStatus status_;
  PlaylistEvent problem_;  ///< event of status_.last_problem
  std::deque<ItemAccount> begun_;
  /// The skipped items by source: `started` of the status, and the reason, at the last report.
  std::map<std::string, std::pair<uint64_t, std::string>> skipped_;
};

}  // namespace lenticule::player
