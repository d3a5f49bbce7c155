// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/playlist_cursor.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "base/error.h"

namespace lenticule::player {
namespace {

/// Returns the place of the item that satisfies the condition; of several, the nearest to `near`.
template <class Condition>
std::optional<size_t> nearest_place(const std::vector<PlaylistItem>& items, size_t near,
                                    Condition condition) {
  const auto distance = [near](size_t place) { return place < near ? near - place : place - near; };
  std::optional<size_t> nearest;
  for (size_t place = 0; place < items.size(); ++place)
    if (condition(items[place]) && (!nearest || distance(place) < distance(*nearest)))
      nearest = place;
  return nearest;
}

}  // namespace

void PlaylistCursor::choose(size_t index, uint64_t rounds_done) {
  chosen_ = index;
  rounds_done_ = rounds_done;
}

void PlaylistCursor::back_to_playing() {
  if (playing_) chosen_ = playing_;
}

PlaylistPlace PlaylistCursor::target_of(const Jump& jump) const {
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
  if (jump.relative) index = ((index + here) % items + items) % items;
  if (!jump.item && !jump.list) index = here;
  if (index < 0 || index >= items)
    throw Error(ErrorKind::Usage, fmt::format("item {}: the list has {} items", index, items),
                "items are counted from 0");
  return {.list = list,
          .index = static_cast<size_t>(index),
          .rounds_done = jump.list ? 0
                         : leaves  ? interrupted_->rounds_done
                                   : rounds_done_,
          .interrupts = jump.interrupts};
}

void PlaylistCursor::jump(const PlaylistPlace& place) {
  if (place.interrupts && !interrupted_)
    interrupted_ = {
        .list = list_, .playing = playing_, .chosen = chosen_, .rounds_done = rounds_done_};
  if (!place.interrupts && place.list != list_) interrupted_.reset();
  list_ = place.list;
  choose(place.index, place.rounds_done);
}

void PlaylistCursor::end_interruption() {
  if (!interrupted_) return;
  const InterruptedPlace place = *std::exchange(interrupted_, std::nullopt);
  list_ = place.list;
  chosen_ = place.playing ? place.playing : place.chosen;
  rounds_done_ = place.rounds_done;
}

void PlaylistCursor::set_loops(uint64_t loops) {
  auto list = std::make_shared<Playlist>(*list_);
  if (list->items.size() == 1) list->items.front().loops = loops;
  if (list->items.size() > 1) list->rounds = loops;
  rounds_done_ = 0;
  list_ = std::move(list);
}

void PlaylistCursor::keep_list(const FileMark& file) {
  auto kept = std::make_shared<Playlist>(*list_);
  kept->file = file;
  list_ = std::move(kept);
}

bool PlaylistCursor::replace_list(std::shared_ptr<const Playlist> list,
                                  const PlaylistItem* playing) {
  list_ = std::move(list);
  const std::vector<PlaylistItem>& items = list_->items;
  if (playing == nullptr) {
    if (chosen_ && *chosen_ >= items.size()) chosen_.reset();
    return false;
  }
  const size_t near = playing_.value_or(0);
  chosen_ = nearest_place(items, near, [&](const auto& item) { return item == *playing; });
  if (chosen_) {
    playing_ = chosen_;
    return true;
  }
  // Changed settings of the item take effect when it begins again, so the item itself is next.
  const auto changed =
      nearest_place(items, near, [&](const auto& item) { return item.source == playing->source; });
  if (changed && *changed > 0) chosen_ = *changed - 1;
  return false;
}

}  // namespace lenticule::player
