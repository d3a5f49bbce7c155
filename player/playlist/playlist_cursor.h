// SPDX-License-Identifier: Apache-2.0
// PlaylistCursor is the place in a playlist: the item that plays, the item chosen last, and the
// rounds. It follows jumps and replaced lists.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "base/error.h"
#include "player/playlist/playlist.h"

namespace lenticule::player {

/// The target of a jump.
struct Jump {
  std::shared_ptr<const Playlist> list = nullptr;  ///< null: the list that is playing
  /// Null: the item that is playing; -1 or 1 with `relative`.
  std::optional<int64_t> item = std::nullopt;
  bool relative = false;
  uint64_t frame = 0;
  /// The target is a list that is played once; then the playing item continues where it was.
  bool interrupts = false;
};

/// A jump's list and item.
struct PlaylistPlace {
  std::shared_ptr<const Playlist> list;
  size_t index = 0;
  uint64_t rounds_done = 0;
  bool interrupts = false;
};

/// The place in a list at which an interruption began.
struct InterruptedPlace {
  std::shared_ptr<const Playlist> list;
  std::optional<size_t> playing;  ///< none: standby, or no item
  std::optional<size_t> chosen;
  uint64_t rounds_done = 0;
};

/// Thread safety: one thread at a time; ItemLoader uses it under its mutex.
class PlaylistCursor {
 public:
  explicit PlaylistCursor(std::shared_ptr<const Playlist> list) : list_(std::move(list)) {}

  /// Returns the list; a changed list has another address.
  [[nodiscard]] const std::shared_ptr<const Playlist>& list() const { return list_; }
  [[nodiscard]] uint64_t rounds_done() const { return rounds_done_; }

  /// Returns the item after the one chosen last.
  [[nodiscard]] NextItem next(LocalTime now) const {
    return next_item(*list_, chosen_, rounds_done_, now);
  }
  /// Chooses an item of the list.
  void choose(size_t index, uint64_t rounds_done) {
    chosen_ = index;
    rounds_done_ = rounds_done;
  }
  /// Notes the item that plays from now on; none for standby.
  void begin(std::optional<size_t> index, uint64_t rounds_done) {
    playing_ = index;
    playing_rounds_ = rounds_done;
  }
  /// Forgets an item that was chosen ahead and will not be played. Returns false if none plays.
  bool back_to_playing() {
    if (playing_) choose(*playing_, playing_rounds_);
    return playing_.has_value();
  }

  /// Returns the place at which a jump arrives. During an interruption, items are those of the
  /// interrupted list. Throws Error(Usage) for an item that the list does not have.
  [[nodiscard]] PlaylistPlace target_of(const Jump& jump) const {
    const bool leaves = interrupted_ && (jump.item || jump.relative);
    const auto playing = leaves ? interrupted_->list : list_;
    const auto list = jump.list ? jump.list : playing;
    const auto items = static_cast<int64_t>(list->items.size());
    const auto at = leaves ? interrupted_->playing : playing_;
    const auto here = static_cast<int64_t>((at       ? at
                                            : leaves ? interrupted_->chosen
                                                     : chosen_)
                                               .value_or(0));
    if (items == 0)
      throw Error(ErrorKind::Failed, list->name + ": has no item at the moment",
                  "wait for a file, or load another source");
    int64_t index = jump.item.value_or(0);
    uint64_t rounds_done = jump.list ? 0 : leaves ? interrupted_->rounds_done : rounds_here();
    if (jump.relative) {
      // Before its first item, a round is the one before, which for round 0 is number -1.
      const bool before =
          index < 0 && list->order(rounds_done).front() == static_cast<size_t>(here);
      index = static_cast<int64_t>(list->beside(static_cast<size_t>(here), index, rounds_done));
      if (before) --rounds_done;
    }
    if (!jump.item && !jump.list) index = here;
    if (index < 0 || index >= items)
      throw Error(ErrorKind::Usage, fmt::format("item {}: the list has {} items", index, items),
                  "items are counted from 0");
    return {.list = list,
            .index = static_cast<size_t>(index),
            .rounds_done = rounds_done,
            .interrupts = jump.interrupts};
  }
  /// Moves to the place. An interruption keeps the place that it interrupts; a second one keeps the
  /// place of the first. A jump to another list ends the interruption.
  void jump(const PlaylistPlace& place) {
    if (place.interrupts && !interrupted_)
      interrupted_ = {
          .list = list_, .playing = playing_, .chosen = chosen_, .rounds_done = rounds_here()};
    if (!place.interrupts && place.list != list_) interrupted_.reset();
    list_ = place.list;
    choose(place.index, place.rounds_done);
  }
  /// Returns the place to which an interruption returns; none if nothing is interrupted.
  [[nodiscard]] const std::optional<InterruptedPlace>& interrupted() const { return interrupted_; }
  /// Ends the interruption: the interrupted list continues after its item.
  void end_interruption() {
    if (!interrupted_) return;
    const InterruptedPlace place = *std::exchange(interrupted_, std::nullopt);
    list_ = place.list;
    chosen_ = place.playing ? place.playing : place.chosen;
    rounds_done_ = place.rounds_done;
  }

  /// Sets the loops of the list, or of its only item, from now on.
  void set_loops(uint64_t loops) {
    auto list = std::make_shared<Playlist>(*list_);
    if (list->items.size() == 1) list->items.front().loops = loops;
    if (list->items.size() > 1) list->rounds = loops;
    rounds_done_ = playing_rounds_ = 0;
    list_ = std::move(list);
  }
  /// Notes the state of the list's file, which is not read until it changes again.
  void keep_list(const FileMark& file) {
    auto kept = std::make_shared<Playlist>(*list_);
    kept->file = file;
    list_ = std::move(kept);
  }
  /// Replaces the list. If it contains `playing` (null: no item of a list is playing), the item
  /// continues there. Otherwise the item that follows it in the new list is next. Returns true if
  /// the item continues.
  bool replace_list(std::shared_ptr<const Playlist> list, const PlaylistItem* playing) {
    list_ = std::move(list);
    const std::vector<PlaylistItem>& items = list_->items;
    if (playing == nullptr) {
      if (chosen_ && *chosen_ >= items.size()) chosen_.reset();
      return false;
    }
    const size_t near = playing_.value_or(0);
    rounds_done_ = rounds_here();
    chosen_ = nearest_place(items, near, [&](const auto& item) { return item == *playing; });
    if (chosen_) {
      playing_ = chosen_;
      return true;
    }
    // Changed settings of the item take effect when it begins again, so the item itself is next.
    const auto changed = nearest_place(
        items, near, [&](const auto& item) { return item.source == playing->source; });
    if (changed && *changed > 0) chosen_ = *changed - 1;
    return false;
  }
  /// Returns the place of the item that plays, or that played last; none for standby.
  [[nodiscard]] std::optional<size_t> playing() const { return playing_; }

 private:
  [[nodiscard]] uint64_t rounds_here() const { return playing_ ? playing_rounds_ : rounds_done_; }
  /// Returns the place of the item that satisfies the condition; of several, the nearest to `near`.
  template <class Condition>
  static std::optional<size_t> nearest_place(const std::vector<PlaylistItem>& items, size_t near,
                                             Condition condition) {
    const auto distance = [near](size_t place) {
      return place < near ? near - place : place - near;
    };
    std::optional<size_t> nearest;
    for (size_t place = 0; place < items.size(); ++place)
      if (condition(items[place]) && (!nearest || distance(place) < distance(*nearest)))
        nearest = place;
    return nearest;
  }

  std::shared_ptr<const Playlist> list_;
  std::optional<size_t> chosen_;
  std::optional<size_t> playing_;
  uint64_t rounds_done_ = 0;     ///< before that of the chosen item
  uint64_t playing_rounds_ = 0;  ///< before that of the playing one, from which jumps count
  std::optional<InterruptedPlace> interrupted_;
};

}  // namespace lenticule::player
