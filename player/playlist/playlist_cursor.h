// SPDX-License-Identifier: Apache-2.0
// PlaylistCursor is the place in a playlist: the item that plays, the item chosen last, and the
// rounds. It follows jumps and replaced lists.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

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
  void choose(size_t index, uint64_t rounds_done);
  /// Notes the item that plays from now on; none for standby.
  void begin(std::optional<size_t> index) { playing_ = index; }
  /// Forgets an item that was chosen ahead and will not be played.
  void back_to_playing();

  /// Returns the place at which a jump arrives. During an interruption, items are those of the
  /// interrupted list. Throws Error(Usage) for an item that the list does not have.
  [[nodiscard]] PlaylistPlace target_of(const Jump& jump) const;
  /// Moves to the place. An interruption keeps the place that it interrupts; a second one keeps the
  /// place of the first. A jump to another list ends the interruption.
  void jump(const PlaylistPlace& place);
  /// Returns the place to which an interruption returns; none if nothing is interrupted.
  [[nodiscard]] const std::optional<InterruptedPlace>& interrupted() const { return interrupted_; }
  /// Ends the interruption: the interrupted list continues after its item.
  void end_interruption();

  /// Sets the loops of the list, or of its only item, from now on.
  void set_loops(uint64_t loops);
  /// Notes the state of the list's file, which is not read until it changes again.
  void keep_list(const FileMark& file);
  /// Replaces the list. If it contains `playing` (null: no item of a list is playing), the item
  /// continues there. Otherwise the item that follows it in the new list is next. Returns true if
  /// the item continues.
  bool replace_list(std::shared_ptr<const Playlist> list, const PlaylistItem* playing);
  /// Returns the place of the item that plays, or that played last; none for standby.
  [[nodiscard]] std::optional<size_t> playing() const { return playing_; }

 private:
  std::shared_ptr<const Playlist> list_;
  std::optional<size_t> chosen_;
  std::optional<size_t> playing_;
  uint64_t rounds_done_ = 0;
  std::optional<InterruptedPlace> interrupted_;
};

}  // namespace lenticule::player
