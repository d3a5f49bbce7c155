// SPDX-License-Identifier: Apache-2.0
#include "player/playlist/item_loader.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// Pause before another attempt when no item can be played or none is
/// scheduled.
constexpr auto kRetry = std::chrono::seconds(1);
/// Time between two checks of the files. A new state must be seen twice in a
/// row, because the file may still be being written.
constexpr auto kLook = std::chrono::seconds(1);
/// Pause in which the loader reads a list again before it tries the list's next item.
constexpr auto kAfterLook = std::chrono::milliseconds(20);
/// Time after which a test card replaces the last frame of items that cannot be played any more.
constexpr auto kUntilCard = std::chrono::seconds(10);

PlaylistItem card_for(const std::string& reason) {
  return {.source = parse_source("card"), .rate = frames::Rate{4, 1}, .reason = reason};
}

PlaylistItem black_item() {
  // Often enough that an item need not wait long for its end.
  return {.source = parse_source("black"), .loops = kForever, .rate = frames::Rate{4, 1}};
}

}  // namespace

ItemLoader::ItemLoader(std::shared_ptr<const Playlist> list, ItemLoaderOptions options,
                       PlaylistReporter& reporter, WakeFd& wake)
    : options_(std::move(options)), reporter_(reporter), wake_(wake), cursor_(std::move(list)) {
  thread_ = std::thread([this] { work(); });
}

ItemLoader::~ItemLoader() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  work_there_.notify_all();
  thread_.join();
  const Error ending(ErrorKind::Failed, "load: the player is ending");
  for (const auto* request : {&request_, &cue_})
    if (*request && (*request)->done) (*request)->done(&ending);
}

std::unique_ptr<OpenItem> ItemLoader::open_item(const PlaylistItem& item, uint64_t frame) const {
  auto open = std::make_unique<OpenItem>();
  open->item = item;
  open->first_frame = frame;
  open->skips_to_first = frame > 0;
  if (options_.look_at) open->files = options_.look_at(item);
  open->opened = options_.open(item, frame);
  const std::string& name = item.source.text;
  const frames::FrameSource& source = *open->opened.source;
  const frames::FrameGeometry size = source.geometry();
  if (size != options_.panel)
    throw Error(ErrorKind::Input,
                fmt::format("{}: frames of {}x{} pixels, but the panel has {}x{}", name, size.width,
                            size.height, options_.panel.width, options_.panel.height),
                "woven frames fit one panel, pixel for pixel");
  if (source.frame_count() && frame >= *source.frame_count())
    throw no_such_frame(item, frame, *source.frame_count());
  return open;
}

ItemLoader::Attempt ItemLoader::try_open(const PlaylistItem& item, uint64_t frame) const {
  try {
    return {.item = open_item(item, frame), .error = std::nullopt};
  } catch (const Error& error) {
    return {.item = nullptr, .error = error};
  } catch (const std::exception& error) {
    return {.item = nullptr,
            .error = Error(ErrorKind::Failed, item.source.text + ": " + error.what())};
  }
}

void ItemLoader::open_first() {
  const std::shared_ptr<const Playlist> list = [this] {
    const std::lock_guard lock(mutex_);
    return cursor_.list();
  }();
  std::unique_ptr<OpenItem> first;
  if (list->is_single() && !list->items.front().schedule) first = open_item(list->items.front(), 0);
  const std::lock_guard lock(mutex_);
  next_wanted_ = first == nullptr;
  if (first) locked_offer(std::move(first), {.kind = NextItem::Kind::Item});
  work_there_.notify_all();
}

void ItemLoader::locked_discard(std::unique_ptr<OpenItem>& item) {
  if (item) trash_.push_back(std::move(item));
}

void ItemLoader::locked_offer(std::unique_ptr<OpenItem> item, const NextItem& pick) {
  item->list = cursor_.list();
  item->interrupts = cursor_.interrupted().has_value();
  if (pick.kind == NextItem::Kind::Item) {
    item->index = pick.index;
    cursor_.choose(pick.index, pick.rounds_done);
  }
  item->rounds_done = cursor_.rounds_done();
  next_ = std::move(item);
  next_wanted_ = false;
  wake_.signal();
}

// --- loader thread ---

void ItemLoader::work() {
  Lock lock(mutex_);
  while (!stopping_) {
    if (!trash_.empty()) {
      empty_trash(lock);
    } else if (request_ && !request_->opened && SteadyClock::now() >= request_at_) {
      open_requested(lock);
    } else if (cue_ && !cue_->opened) {
      open_cued(lock);
    } else if (cue_ && cue_->item && !cue_->decoded && SteadyClock::now() >= cue_look_at_) {
      look_at_cued(lock);
    } else if (next_wanted_ && !next_ && !list_over_ && SteadyClock::now() >= retry_at_) {
      open_next(lock);
    } else if (is_time_to_look()) {
      look_at_ = SteadyClock::now() + kLook;
      const bool at_once = std::exchange(look_now_, false);
      look_at_list(lock, at_once);
      look_at_item(lock);
    } else {
      work_there_.wait_until(lock, next_step());
    }
  }
}

/// Returns the time at which the loader looks for work without being woken.
ItemLoader::SteadyTime ItemLoader::next_step() const {
  const SteadyTime now = SteadyClock::now();
  SteadyTime next = now + kRetry;
  if (request_ && !request_->opened) next = std::min(next, request_at_);
  if (cue_ && cue_->item && !cue_->decoded) next = std::min(next, cue_look_at_);
  if (next_wanted_ && !next_ && !list_over_) next = std::min(next, retry_at_);
  return std::max(next, now);
}

void ItemLoader::empty_trash(Lock& lock) {
  std::vector<std::unique_ptr<OpenItem>> trash = std::move(trash_);
  trash_.clear();
  lock.unlock();
  trash.clear();
  lock.lock();
}

void ItemLoader::open_next(Lock& lock) {
  const auto list = cursor_.list();
  const uint64_t serial = request_serial_;
  const LocalTime now = options_.local_time();
  NextItem pick = cursor_.next(now);
  if (pick.kind == NextItem::Kind::End && cursor_.interrupted()) return open_interrupted(lock);
  const bool again = locked_outlasts();
  if (pick.kind == NextItem::Kind::End && again)
    pick = {.kind = NextItem::Kind::Item, .index = 0, .rounds_done = cursor_.rounds_done()};
  nothing_for_now_ = pick.kind == NextItem::Kind::None;
  list_over_ = pick.kind == NextItem::Kind::End;
  const std::string why = list_over_ && shown_ ? std::string() : locked_reason_to_wait(now);
  const bool is_news = !why.empty() && reporter_.note_waiting(why);
  if (list_over_) return wake_.signal();
  if (is_news) {
    lock.unlock();
    reporter_.waits(list->name, why);
    lock.lock();
    if (serial != request_serial_ || list != cursor_.list()) return;
  }
  std::optional<PlaylistItem> standby;
  if (nothing_for_now_ || locked_none_works()) standby = locked_standby_to_open();
  if (nothing_for_now_ && !standby) {
    locked_pause();
    return wake_.signal();
  }
  if (standby) pick.kind = NextItem::Kind::None;
  const PlaylistItem item = standby ? *standby : list->items[pick.index];
  lock.unlock();
  if (again && list->items.size() == 1 && !standby && is_changing(item)) {
    lock.lock();
    broken_since_ = SteadyClock::now();
    return locked_pause();
  }
  Attempt attempt = try_open(item, 0);
  // A file that was removed from a folder is no fault: the list is read again first.
  const bool list_is_old = !attempt.item && is_list_changed(*list);
  lock.lock();
  if (serial != request_serial_ || list != cursor_.list()) return locked_discard(attempt.item);
  if (attempt.item && again && !standby) {
    attempt.item->loops_done = broken_loops_;
    broken_files_.clear();  // if it breaks again, a pause comes first
  }
  if (attempt.item) return locked_offer(std::move(attempt.item), pick);
  if (list_is_old) {
    look_now_ = true;
    retry_at_ = SteadyClock::now() + kAfterLook;
    return;
  }
  if (!standby) cursor_.choose(pick.index, pick.rounds_done);
  const uint64_t loops_done = again ? broken_loops_ : 0;
  lock.unlock();
  skip(item.source.text, with_remedy(*attempt.error), standby.has_value(), false, loops_done);
  lock.lock();
}

bool ItemLoader::locked_outlasts() const {
  const bool repeats = options_.outlasts_faults || cursor_.list()->rounds != 1;
  const bool is_last = broke_off_ && cursor_.list()->items.size() == 1;
  return repeats && shown_ && !cursor_.interrupted() && (is_last || locked_none_works());
}

/// Returns true until two checks in a row find the files of an item unchanged.
bool ItemLoader::is_changing(const PlaylistItem& item) {
  if (!options_.look_at) return false;
  std::vector<FileMark> now = options_.look_at(item);
  return std::exchange(broken_files_, now) != now;
}

// --- times without an item ---

bool ItemLoader::locked_none_works() const {
  const size_t scheduled = cursor_.list()->items_scheduled(options_.local_time());
  return scheduled > 0 && unplayable_in_a_row_ >= scheduled;
}

std::optional<PlaylistItem> ItemLoader::locked_standby() const {
  const Playlist& list = *cursor_.list();
  if (list.standby && !standby_broken_) return list.standby;
  if (list.awaits_files || !shown_) return black_item();
  if (locked_outlasts() && SteadyClock::now() >= broken_since_ + kUntilCard)
    return card_for(problem_);
  return std::nullopt;
}

std::optional<PlaylistItem> ItemLoader::locked_standby_to_open() const {
  auto standby = locked_standby();
  return followed_.standby && standby == followed_.item ? std::nullopt : std::move(standby);
}

/// Delays the next attempt when no item can be played or none is scheduled.
void ItemLoader::locked_pause() {
  retry_at_ = SteadyClock::now() + kRetry;
  standby_broken_ = false;
}

std::string ItemLoader::locked_reason_to_wait(LocalTime now) const {
  const Playlist& list = *cursor_.list();
  if (!locked_none_works()) return reason_to_wait(list, now);
  const size_t scheduled = list.items_scheduled(now);
  if (scheduled == 1) return problem_;
  return fmt::format("none of {} items can be played: {}", scheduled, problem_);
}

// --- replaced files ---

bool ItemLoader::is_time_to_look() const {
  const bool follows = options_.look_at || options_.read_list;
  return follows && !ended_ && (look_now_ || SteadyClock::now() >= look_at_);
}

FileMark ItemLoader::mark_of_list(const std::string& name) const {
  return options_.mark_list ? options_.mark_list(name) : mark_of(name);
}

bool ItemLoader::is_list_changed(const Playlist& list) const {
  return options_.read_list && list.file && mark_of_list(list.name) != *list.file;
}

/// Reads the list if its file was replaced. A list that cannot be read is not
/// tried again until its file changes.
void ItemLoader::look_at_list(Lock& lock, bool at_once) {
  const auto list = cursor_.list();
  if (!options_.read_list || !list->file) return;
  lock.unlock();
  const FileMark now = mark_of_list(list->name);
  lock.lock();
  const bool steady = std::exchange(list_seen_, now) == now;
  const bool is_new = now != *list->file;
  if (list != cursor_.list() || !(at_once || (is_new && steady))) return;
  lock.unlock();
  std::optional<Playlist> read;
  std::string why;
  try {
    read = options_.read_list(list->name);
  } catch (const std::exception& error) {
    why = error.what();
  }
  lock.lock();
  if (list != cursor_.list()) return;
  const bool is_read = read.has_value();
  if (is_read)
    locked_take_list(std::move(*read));
  else
    cursor_.keep_list(now);
  lock.unlock();
  if (is_read)
    reporter_.replaced(list->name);
  else
    reporter_.kept(list->name, why);
  lock.lock();
}

/// Replaces the list. An item that the new list does not contain ends with its
/// round.
void ItemLoader::locked_take_list(Playlist list) {
  const auto taken = std::make_shared<const Playlist>(std::move(list));
  const bool plays_item = followed_.number != 0 && !followed_.standby;
  const bool continues = cursor_.replace_list(taken, plays_item ? &followed_.item : nullptr);
  standby_broken_ = broke_off_ = false;
  outdated_ = plays_item ? !continues : followed_.standby && locked_standby() != followed_.item;
  next_wanted_ = next_wanted_ || next_;
  locked_discard(next_);
  list_over_ = nothing_for_now_ = false;
  retry_at_ = {};
  unplayable_in_a_row_ = 0;
  reporter_.take_list(taken->items.size(), cursor_.playing());
  wake_.signal();
}

/// Opens the item again if its files were replaced. Not needed when the next
/// item is already being opened.
void ItemLoader::look_at_item(Lock& lock) {
  if (!options_.look_at || followed_.number == 0 || next_ || next_wanted_ || request_ || outdated_)
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
  Attempt attempt = try_open(item, 0);
  std::unique_ptr<OpenItem>& open = attempt.item;
  if (!open) reporter_.kept(item.source.text, attempt.error->what());
  lock.lock();
  if (!open) return;
  if (followed_.number != number) return locked_discard(open);
  open->number = number;
  open->list = cursor_.list();
  open->index = cursor_.playing();
  open->rounds_done = followed_.rounds_done;
  locked_discard(replacement_);
  replacement_ = std::move(open);
}

// --- filler ---

ItemLoader::Offer ItemLoader::take_next() {
  const std::lock_guard lock(mutex_);
  if (!next_ && !list_over_ && !next_wanted_) {
    next_wanted_ = true;
    work_there_.notify_all();
  }
  if (!next_) return {};
  if (next_->item.waits_until_primed && !next_->opened.source->saturated())
    return {.item = nullptr, .primes = true};
  return {.item = std::move(next_), .primes = false};
}

void ItemLoader::want_next() {
  const std::lock_guard lock(mutex_);
  next_wanted_ = true;
  work_there_.notify_all();
}

bool ItemLoader::next_is_there() const {
  const std::lock_guard lock(mutex_);
  return next_ != nullptr;
}

ItemLoader::Prospect ItemLoader::prospect() {
  const std::lock_guard lock(mutex_);
  ended_ = list_over_ && !request_ && !cue_ && !next_ && !held_;
  if (ended_) return Prospect::Ended;
  const bool waits = list_over_ && cue_;
  const bool idle = held_ || nothing_for_now_ || broke_off_ || request_ || waits;
  return idle ? Prospect::Idle : Prospect::Soon;
}

void ItemLoader::begin(const OpenItem& item) {
  const std::lock_guard lock(mutex_);
  followed_ = {.number = item.number,
               .standby = !item.index,
               .rounds_done = item.rounds_done,
               .item = item.item,
               .files = item.files,
               .seen = item.files};
  outdated_ = false;
  locked_discard(replacement_);
  if (item.returns && cursor_.interrupted()) locked_end_interruption();
  cursor_.begin(item.index);
  if (!item.index) locked_pause();
}

void ItemLoader::leave() {
  const std::lock_guard lock(mutex_);
  followed_ = {};
}

void ItemLoader::note_first_frame(const OpenItem& item) {
  const std::lock_guard lock(mutex_);
  shown_ = true;
  broke_off_ = false;
  if (item.index) unplayable_in_a_row_ = 0;
}

void ItemLoader::skip(const std::string& source, const std::string& why, bool standby, bool played,
                      uint64_t loops_done) {
  const std::string problem = why.starts_with(source) ? why : source + ": " + why;
  {
    const std::lock_guard lock(mutex_);
    const bool is_known = !played && locked_none_works() && problem_ == problem;
    if (!broke_off_ && unplayable_in_a_row_ == 0) broken_since_ = SteadyClock::now();
    broke_off_ = true;
    broken_loops_ = loops_done;
    if (!played) locked_note_unplayable(standby, problem);
    if (locked_outlasts()) list_over_ = false;
    if (is_known) return;
  }
  reporter_.skipped(source, why);
}

void ItemLoader::locked_note_unplayable(bool standby, const std::string& problem) {
  if (standby && cursor_.list()->standby && !standby_broken_) {
    standby_broken_ = true;
  } else if (standby) {  // black
    shown_ = true;
    locked_pause();
  } else {
    // Attempts after the first round have other problems, which would be reported every second.
    if (!locked_none_works()) problem_ = problem;
    ++unplayable_in_a_row_;
    if (locked_none_works() && !locked_standby_to_open()) locked_pause();
  }
}

void ItemLoader::close(std::unique_ptr<OpenItem> item) {
  const std::lock_guard lock(mutex_);
  trash_.push_back(std::move(item));
  work_there_.notify_all();
}

uint64_t ItemLoader::loops_of(const OpenItem& item) const {
  const std::lock_guard lock(mutex_);
  const std::vector<PlaylistItem>& items = cursor_.list()->items;
  return items.size() == 1 && item.index ? items.front().loops : item.item.loops;
}

bool ItemLoader::is_outdated() const {
  const std::lock_guard lock(mutex_);
  return outdated_;
}

std::unique_ptr<OpenItem> ItemLoader::take_replacement(uint32_t number) {
  const std::lock_guard lock(mutex_);
  if (!replacement_ || replacement_->number != number) return nullptr;
  return std::move(replacement_);
}

// --- any thread ---

std::shared_ptr<const Playlist> ItemLoader::list() const {
  const std::lock_guard lock(mutex_);
  return cursor_.interrupted() ? cursor_.interrupted()->list : cursor_.list();
}

void ItemLoader::set_loops(uint64_t loops) {
  const std::lock_guard lock(mutex_);
  cursor_.set_loops(loops);
  list_over_ = false;
  work_there_.notify_all();
}

void ItemLoader::hold(bool held) {
  const std::lock_guard lock(mutex_);
  held_ = held;
  wake_.signal();
}

void ItemLoader::look_again() {
  const std::lock_guard lock(mutex_);
  look_now_ = true;
  work_there_.notify_all();
}

}  // namespace lenticule::player
