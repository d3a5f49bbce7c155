// SPDX-License-Identifier: Apache-2.0
// The other half of PlaylistSource: the thread that opens and closes items, and the functions that
// any thread may call.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "player/playlist/playlist_source.h"

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// Pause before another attempt when no item can be played or none is scheduled.
constexpr auto kRetry = std::chrono::seconds(1);
/// Time between two checks of the files. A new state must be seen twice in a row, because the file
/// may still be being written.
constexpr auto kLook = std::chrono::seconds(1);

}  // namespace

std::unique_ptr<PlaylistSource::Play> PlaylistSource::open_play(const PlaylistItem& item,
                                                                uint64_t frame) const {
  auto play = std::make_unique<Play>();
  play->item = item;
  play->first_frame = frame;
  play->skips_to_first = frame > 0;
  if (options_.look_at) play->files = options_.look_at(item);
  play->opened = options_.open(item, frame);
  const frames::FrameSource& source = *play->opened.source;
  const frames::FrameGeometry size = source.geometry();
  if (size != options_.panel)
    throw Error(ErrorKind::Input,
                fmt::format("{}: frames of {}x{} pixels, but the panel has {}x{}", item.source.text,
                            size.width, size.height, options_.panel.width, options_.panel.height),
                "woven frames fit one panel, pixel for pixel");
  if (source.frame_count() && frame >= *source.frame_count())
    throw Error(
        ErrorKind::Usage,
        fmt::format("frame {}: {} has {} frames", frame, item.source.text, *source.frame_count()),
        "frames are counted from 0");
  return play;
}

void PlaylistSource::open_first() {
  const auto list = list_;
  std::unique_ptr<Play> first;
  if (list->items.size() == 1 && !list->items.front().schedule)
    first = open_play(list->items.front(), 0);
  const std::lock_guard lock(mutex_);
  next_wanted_ = first == nullptr;
  if (first) note_opened(std::move(first), {.kind = NextItem::Kind::Item});
  work_there_.notify_all();
}

// --- opening thread -------------------------------------------------------------------------

void PlaylistSource::work() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    if (!trash_.empty()) {
      std::vector<std::unique_ptr<Play>> trash = std::move(trash_);
      trash_.clear();
      lock.unlock();
      trash.clear();
      lock.lock();
    } else if (wish_ && !wish_->opened) {
      open_wish(lock);
    } else if (next_wanted_ && !next_ && !list_over_ && SteadyClock::now() >= retry_at_) {
      open_next(lock);
    } else if (is_time_to_look()) {
      look_at_files(lock);
    } else {
      work_there_.wait_for(lock, kRetry);
    }
  }
}

/// Opens the target of a jump. At most two items are open beside the displayed one, so the item
/// that was to be next is closed.
void PlaylistSource::open_wish(std::unique_lock<std::mutex>& lock) {
  wish_->opened = true;
  const uint64_t serial = wish_->serial;
  const PlaylistItem item = wish_->item;
  const uint64_t frame = wish_->frame;
  std::unique_ptr<Play> gone = std::move(next_);
  const bool next_was_wanted = next_wanted_ || gone;
  next_wanted_ = false;
  if (gone) position_ = status_.item ? status_.item : position_;
  lock.unlock();
  gone.reset();
  std::unique_ptr<Play> play;
  std::optional<Error> error;
  try {
    play = open_play(item, frame);
  } catch (const Error& thrown) {
    error = thrown;
  } catch (const std::exception& thrown) {
    error.emplace(ErrorKind::Failed, item.source.text + ": " + thrown.what());
  }
  lock.lock();
  if (!wish_ || wish_->serial != serial) {
    if (play) trash_.push_back(std::move(play));
    return;
  }
  if (play) {
    play->list = wish_->list;
    play->index = wish_->index;
    play->rounds_done = wish_->rounds_done;
    wish_->play = std::move(play);
    return wake_filler();
  }
  const JumpDone done = std::move(wish_->done);
  wish_.reset();
  next_wanted_ = next_was_wanted;
  lock.unlock();
  done(&*error);
  wake_filler();
  lock.lock();
}

void PlaylistSource::open_next(std::unique_lock<std::mutex>& lock) {
  const auto list = list_;
  const uint64_t serial = wish_serial_;
  const NextItem pick = next_item(*list, position_, rounds_done_, options_.local_time());
  nothing_for_now_ = pick.kind == NextItem::Kind::None;
  list_over_ = pick.kind == NextItem::Kind::End;
  const bool waits = pick.kind == NextItem::Kind::Standby && on_standby_;
  if (nothing_for_now_ || waits) retry_at_ = SteadyClock::now() + kRetry;
  if (nothing_for_now_ || list_over_ || waits) return wake_filler();

  const bool standby = pick.kind == NextItem::Kind::Standby;
  const PlaylistItem item = standby ? *list->standby : list->items[pick.index];
  lock.unlock();
  std::unique_ptr<Play> play;
  std::string why;
  try {
    play = open_play(item, 0);
  } catch (const std::exception& error) {
    why = error.what();
  }
  lock.lock();
  if (serial != wish_serial_ || list != list_) {
    if (play) trash_.push_back(std::move(play));
    return;
  }
  if (play) return note_opened(std::move(play), pick);
  if (!standby) {
    position_ = pick.index;
    rounds_done_ = pick.rounds_done;
  }
  if (broken_in_a_row_ + 1 >= list->items.size() || standby)
    retry_at_ = SteadyClock::now() + kRetry;
  lock.unlock();
  count_skipped(item.source.text, why);
  lock.lock();
}

/// Call with the lock held.
void PlaylistSource::note_opened(std::unique_ptr<Play> play, const NextItem& pick) {
  play->list = list_;
  if (pick.kind == NextItem::Kind::Item) {
    play->index = position_ = pick.index;
    rounds_done_ = pick.rounds_done;
  }
  play->rounds_done = rounds_done_;
  next_ = std::move(play);
  next_wanted_ = false;
  wake_filler();
}

// --- replaced files -------------------------------------------------------------------------

bool PlaylistSource::is_time_to_look() const {
  const bool follows = options_.look_at || options_.read_list;
  return follows && !ended_ && (look_now_ || SteadyClock::now() >= look_at_);
}

void PlaylistSource::look_at_files(std::unique_lock<std::mutex>& lock) {
  look_at_ = SteadyClock::now() + kLook;
  const bool at_once = std::exchange(look_now_, false);
  look_at_list(lock, at_once);
  look_at_item(lock);
}

/// Reads the list if its file was replaced. A list that cannot be read is not tried again until its
/// file changes.
void PlaylistSource::look_at_list(std::unique_lock<std::mutex>& lock, bool at_once) {
  const auto list = list_;
  if (!options_.read_list || !list->file) return;
  lock.unlock();
  const FileMark now = mark_of(list->name);
  lock.lock();
  const bool steady = std::exchange(list_seen_, now) == now;
  const bool is_new = now != *list->file;
  if (list != list_ || !(at_once || (is_new && steady))) return;
  lock.unlock();
  std::optional<Playlist> read;
  std::string why;
  try {
    read = options_.read_list(list->name);
  } catch (const std::exception& error) {
    why = error.what();
  }
  lock.lock();
  if (list != list_) return;
  if (read) {
    take_list(std::move(*read));
  } else {
    auto kept = std::make_shared<Playlist>(*list);
    kept->file = now;
    list_ = std::move(kept);
  }
  lock.unlock();
  tell(read ? PlaylistEvent::Kind::Replaced : PlaylistEvent::Kind::Kept, list->name, why);
  lock.lock();
}

/// Replaces the list; call with the lock held. If the new list contains the playing item, the item
/// continues; otherwise it ends with its round, and the item that follows it in the new list is
/// next.
void PlaylistSource::take_list(Playlist list) {
  auto taken = std::make_shared<const Playlist>(std::move(list));
  const std::vector<PlaylistItem>& items = taken->items;
  const auto place_of = [&](auto&& is_it) -> std::optional<size_t> {
    const auto found = std::find_if(items.begin(), items.end(), is_it);
    if (found == items.end()) return std::nullopt;
    return static_cast<size_t>(found - items.begin());
  };
  const PlaylistItem& playing = followed_.item;
  const bool plays_item = followed_.number != 0 && !on_standby_;
  outdated_ = on_standby_ && taken->standby != playing;
  if (plays_item) {
    const auto is_same = [&](const PlaylistItem& item) { return item == playing; };
    const auto here = status_.item.value_or(items.size());
    const auto same = here < items.size() && is_same(items[here]) ? here : place_of(is_same);
    outdated_ = !same;
    // Changed settings of the item take effect when it begins again.
    const auto changed =
        place_of([&](const PlaylistItem& item) { return item.source == playing.source; });
    const bool comes_first = !same && changed.value_or(0) == 0;
    position_ = same ? same : changed;
    if (comes_first) position_.reset();
    if (!same && position_) --*position_;
    if (same) status_.item = same;
  } else if (position_ && *position_ >= items.size()) {
    position_.reset();
  }
  next_wanted_ = next_wanted_ || next_;
  if (next_) trash_.push_back(std::move(next_));
  list_over_ = nothing_for_now_ = false;
  retry_at_ = {};
  broken_in_a_row_ = 0;
  status_.items = items.size();
  list_ = std::move(taken);
  wake_filler();
}

/// Opens the item again if its files were replaced. Not needed when the next item is already being
/// opened.
void PlaylistSource::look_at_item(std::unique_lock<std::mutex>& lock) {
  if (!options_.look_at || followed_.number == 0 || next_ || next_wanted_ || wish_ || outdated_)
    return;
  const uint32_t number = followed_.number;
  const PlaylistItem item = followed_.item;
  if (followed_.files.empty()) return;
  lock.unlock();
  const std::vector<FileMark> now = options_.look_at(item);
  lock.lock();
  if (followed_.number != number) return;
  const bool steady = std::exchange(followed_.seen, now) == now;
  if (!steady || now == followed_.files) return;
  followed_.files = now;
  lock.unlock();
  std::unique_ptr<Play> play;
  std::string why;
  try {
    play = open_play(item, 0);
  } catch (const std::exception& error) {
    why = error.what();
  }
  lock.lock();
  if (!play) {
    lock.unlock();
    tell(PlaylistEvent::Kind::Kept, item.source.text, why);
    lock.lock();
    return;
  }
  if (replacement_) trash_.push_back(std::move(replacement_));
  play->number = number;
  play->list = list_;
  play->index = status_.item;
  play->rounds_done = status_.rounds_done;
  replacement_ = std::move(play);
  if (followed_.number != number) trash_.push_back(std::move(replacement_));
}

void PlaylistSource::look_again() {
  const std::lock_guard lock(mutex_);
  look_now_ = true;
  work_there_.notify_all();
}

// --- any thread -----------------------------------------------------------------------------

void PlaylistSource::jump(Jump jump, JumpDone done) {
  std::optional<Wish> replaced;
  std::optional<Error> error;
  {
    const std::lock_guard lock(mutex_);
    const auto list = jump.list ? jump.list : list_;
    const auto items = static_cast<int64_t>(list->items.size());
    const std::optional<size_t> here = status_.item ? status_.item : position_;
    int64_t index = jump.item.value_or(0);
    if (jump.relative) index += static_cast<int64_t>(here.value_or(0));
    if (jump.relative) index = (index % items + items) % items;
    const bool stays = !jump.item && !jump.list;
    if (stays) index = static_cast<int64_t>(here.value_or(0));
    if (ended_) {
      error.emplace(ErrorKind::Failed, "control: playing is about to end", "pause it earlier");
    } else if (index < 0 || index >= items) {
      error.emplace(ErrorKind::Usage, fmt::format("item {}: the list has {}", index, items),
                    "items are counted from 0");
    } else {
      const auto at = static_cast<size_t>(index);
      replaced = std::exchange(wish_, Wish{.play = nullptr,
                                           .item = list->items[at],
                                           .list = list,
                                           .index = at,
                                           .rounds_done = jump.list ? 0 : rounds_done_,
                                           .frame = jump.frame,
                                           .serial = ++wish_serial_,
                                           .opened = false,
                                           .done = done,
                                           .since = SteadyClock::now()});
      if (replaced && replaced->play) trash_.push_back(std::move(replaced->play));
    }
  }
  work_there_.notify_all();
  if (error) return done(&*error);
  const Error superseded(ErrorKind::Failed, "load: another one came before it was ready");
  if (replaced && replaced->done) replaced->done(&superseded);
}

void PlaylistSource::set_loops(uint64_t loops) {
  const std::lock_guard lock(mutex_);
  auto list = std::make_shared<Playlist>(*list_);
  if (list->items.size() == 1) list->items.front().loops = loops;
  if (list->items.size() > 1) list->rounds = loops;
  rounds_done_ = 0;
  list_ = std::move(list);
  list_over_ = false;
  work_there_.notify_all();
}

void PlaylistSource::hold(bool held) {
  const std::lock_guard lock(mutex_);
  held_ = held;
  wake_filler();
}

PlaylistStatus PlaylistSource::status() const {
  const std::lock_guard lock(mutex_);
  PlaylistStatus status = status_;
  status.opening = wish_.has_value();
  return status;
}

frames::FrameDamage PlaylistSource::damage() const {
  const std::lock_guard lock(mutex_);
  return status_.damage;
}

std::string PlaylistSource::source_of(uint32_t play) const {
  const std::lock_guard lock(mutex_);
  for (const Began& one : began_)
    if (one.number == play) return one.source;
  return {};
}

std::optional<size_t> PlaylistSource::place_of(uint32_t play) const {
  const std::lock_guard lock(mutex_);
  for (const Began& one : began_)
    if (one.number == play) return one.index;
  return std::nullopt;
}

void PlaylistSource::count_skipped(const std::string& source, const std::string& why) {
  {
    const std::lock_guard lock(mutex_);
    ++status_.skipped;
    ++broken_in_a_row_;
    status_.last_trouble = why;
  }
  tell(PlaylistEvent::Kind::ItemSkipped, source, why);
}

void PlaylistSource::tell(PlaylistEvent::Kind kind, const std::string& source,
                          const std::string& detail) {
  if (kind == PlaylistEvent::Kind::Seam) {
    const std::lock_guard lock(mutex_);
    ++status_.seams;
  }
  if (options_.on_event) options_.on_event({kind, source, detail});
}

}  // namespace lenticule::player
