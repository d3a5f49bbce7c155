// SPDX-License-Identifier: Apache-2.0
// The part of ItemLoader that leaves the order of the list: jumps, cued items, and interruptions
// with the return from them.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "player/playlist/item_loader.h"

namespace lenticule::player {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// Pause before the loader looks again for something that takes a few frames.
constexpr auto kSoon = std::chrono::milliseconds(10);
/// Time after which the panel is not expected to show the first frame of an interruption.
constexpr auto kLongestFlip = std::chrono::milliseconds(500);
constexpr auto kLongestDecoding = std::chrono::seconds(30);

Error about_to_end() {
  return {ErrorKind::Failed, "control: playback is about to end", "pause it earlier"};
}

/// Returns the frame at which an item is opened to continue. A ring has no earlier frames.
uint64_t opening_frame(const PlaylistItem& item, uint64_t frame) {
  return item.source.kind == SourceKind::Ring ? 0 : frame;
}

/// Tells the requester of a jump that a later one has replaced it.
void report_superseded(const JumpDone& done) {
  const Error superseded(ErrorKind::Failed, "load: replaced by a later load before it was ready");
  if (done) done(&superseded);
}

}  // namespace

// --- jumps, any thread ---

JumpDone ItemLoader::locked_request(JumpRequest request) {
  request.serial = ++request_serial_;
  request_at_ = {};
  std::optional<JumpRequest> replaced = std::exchange(request_, std::move(request));
  if (!replaced) return nullptr;
  locked_discard(replaced->item);
  return std::move(replaced->done);
}

void ItemLoader::jump(const Jump& jump, const JumpDone& done) {
  JumpDone replaced;
  try {
    const std::lock_guard lock(mutex_);
    if (ended_) throw about_to_end();
    replaced = locked_request({.place = cursor_.target_of(jump),
                               .frame = jump.frame,
                               .done = done,
                               .since = SteadyClock::now()});
  } catch (const Error& error) {
    return done(&error);
  }
  work_there_.notify_all();
  report_superseded(replaced);
}

bool ItemLoader::is_jumping() const {
  const std::lock_guard lock(mutex_);
  return request_.has_value();
}

// --- jumps, loader thread ---

/// Opens the target of a jump. At most two items are open beside the displayed
/// one, so the item that was to be next is closed.
void ItemLoader::open_requested(Lock& lock) {
  if (request_->returns && !locked_find_progress(request_->since + kLongestFlip)) {
    request_at_ = SteadyClock::now() + kSoon;
    return;
  }
  request_->opened = true;
  const uint64_t serial = request_->serial;
  const PlaylistPlace place = request_->place;
  const PlaylistItem& item = place.list->items[place.index];
  const uint64_t frame =
      request_->returns ? opening_frame(item, interrupted_.frame) : request_->frame;
  std::unique_ptr<OpenItem> gone = std::move(next_);
  const bool next_was_wanted = next_wanted_ || gone;
  next_wanted_ = false;
  if (gone) cursor_.back_to_playing();
  lock.unlock();
  gone.reset();
  Attempt attempt = try_open(item, frame);
  lock.lock();
  if (!request_ || request_->serial != serial) return locked_discard(attempt.item);
  if (attempt.item) {
    attempt.item->list = place.list;
    attempt.item->index = place.index;
    attempt.item->rounds_done = place.rounds_done;
    attempt.item->interrupts = place.interrupts;
    if (request_->returns) continue_item(*attempt.item, interrupted_);
    request_->item = std::move(attempt.item);
    return wake_.signal();
  }
  const JumpDone done = std::move(request_->done);
  request_.reset();
  next_wanted_ = next_was_wanted;
  lock.unlock();
  done(&*attempt.error);
  wake_.signal();
  lock.lock();
}

// --- jumps, frame copier ---

std::optional<ItemLoader::Arrival> ItemLoader::take_arrival() {
  const std::lock_guard lock(mutex_);
  if (!request_ || !request_->item) return std::nullopt;
  return Arrival{
      .item = std::move(request_->item), .serial = request_->serial, .since = request_->since};
}

void ItemLoader::put_back(Arrival arrival) {
  {
    const std::lock_guard lock(mutex_);
    if (request_ && request_->serial == arrival.serial) request_->item = std::move(arrival.item);
  }
  if (arrival.item) close(std::move(arrival.item));
}

JumpDone ItemLoader::accept(uint64_t serial, const ItemProgress& leaving) {
  const std::lock_guard lock(mutex_);
  if (!request_ || request_->serial != serial) return nullptr;
  JumpDone done = std::move(request_->done);
  const bool interrupts = request_->place.interrupts;
  if (interrupts && !cursor_.interrupted()) interrupted_ = leaving;
  // A second interruption: later, the panel may no longer know the first one's predecessor.
  if (interrupts) (void)locked_find_progress();
  if (!request_->returns) cursor_.jump(request_->place);  // begin() returns
  if (!cursor_.interrupted()) interrupted_ = {};
  list_over_ = nothing_for_now_ = false;
  ++request_serial_;  // discards the item being opened for the old place
  locked_discard(next_);
  next_wanted_ = false;
  request_.reset();
  return done;
}

void ItemLoader::fail(Arrival arrival, const Error& error) {
  close(std::move(arrival.item));
  JumpDone done;
  {
    const std::lock_guard lock(mutex_);
    if (!request_ || request_->serial != arrival.serial) return;
    done = std::move(request_->done);
    request_.reset();
    next_wanted_ = true;
    work_there_.notify_all();
  }
  done(&error);
}

// --- interruptions ---

bool ItemLoader::locked_find_progress(SteadyTime give_up) {
  if (interrupted_.final || interrupted_.number == 0) return true;
  LeftItem left;
  if (options_.left_item)
    left = options_.left_item(interrupted_.number);
  else if (interrupted_.given > 0)
    left.last = {.index = interrupted_.given - 1, .number = interrupted_.frame};
  if (left.still_displayed && SteadyClock::now() < give_up) return false;
  interrupted_ = progress_at(interrupted_, left);
  return true;
}

/// Opens the interrupted item ahead of the end of the interruption. begin() then returns to its
/// list.
void ItemLoader::open_interrupted(Lock& lock) {
  const InterruptedPlace place = *cursor_.interrupted();
  if (!place.playing) return locked_end_interruption();
  if (!locked_find_progress()) {
    retry_at_ = SteadyClock::now() + kSoon;
    return;
  }
  const uint64_t serial = request_serial_;
  const auto list = cursor_.list();
  const PlaylistItem& item = place.list->items[*place.playing];
  const uint64_t frame = opening_frame(item, interrupted_.frame);
  lock.unlock();
  Attempt attempt = try_open(item, frame);
  lock.lock();
  if (serial != request_serial_ || list != cursor_.list()) return locked_discard(attempt.item);
  if (attempt.item) {
    attempt.item->list = place.list;
    attempt.item->index = place.playing;
    attempt.item->rounds_done = place.rounds_done;
    continue_item(*attempt.item, interrupted_);
    next_ = std::move(attempt.item);
    next_wanted_ = false;
    return wake_.signal();
  }
  locked_end_interruption();
  lock.unlock();
  skip(item.source.text, with_remedy(*attempt.error), false, false, 0);
  lock.lock();
}

void ItemLoader::locked_end_interruption() {
  cursor_.end_interruption();
  interrupted_ = {};
}

void ItemLoader::return_now(const JumpDone& done) {
  JumpDone replaced;
  bool by_itself = false;
  try {
    const std::lock_guard lock(mutex_);
    if (ended_) throw about_to_end();
    const auto& place = cursor_.interrupted();
    if (!place)
      throw Error(ErrorKind::Failed, "back: nothing is interrupted",
                  "'interrupt' and 'blank' begin an interruption");
    by_itself = !place->playing;
    if (by_itself) {
      locked_end_interruption();
      outdated_ = next_wanted_ = true;
      locked_discard(next_);
    } else {
      replaced = locked_request({.place = {.list = place->list,
                                           .index = *place->playing,
                                           .rounds_done = place->rounds_done},
                                 .returns = true,
                                 .done = done,
                                 .since = SteadyClock::now()});
    }
  } catch (const Error& error) {
    return done(&error);
  }
  work_there_.notify_all();
  report_superseded(replaced);
  if (by_itself) done(nullptr);
}

std::string ItemLoader::interrupted() const {
  const std::lock_guard lock(mutex_);
  const auto& place = cursor_.interrupted();
  if (!place) return {};
  return place->playing ? place->list->items[*place->playing].source.text : place->list->name;
}

// --- cued items ---

void ItemLoader::cue(const Jump& jump, const JumpDone& done) {
  std::optional<JumpRequest> replaced;
  try {
    const std::lock_guard lock(mutex_);
    if (ended_) throw about_to_end();
    replaced = std::exchange(cue_, JumpRequest{.place = cursor_.target_of(jump),
                                               .frame = jump.frame,
                                               .serial = ++cue_serial_,
                                               .in_present_list = jump.list == nullptr,
                                               .done = done,
                                               .since = SteadyClock::now()});
    if (replaced) locked_discard(replaced->item);
  } catch (const Error& error) {
    return done(&error);
  }
  work_there_.notify_all();
  const Error superseded(ErrorKind::Failed, "cue: replaced by a later cue before it was ready");
  if (replaced && replaced->done) replaced->done(&superseded);
}

void ItemLoader::open_cued(Lock& lock) {
  cue_->opened = true;
  const uint64_t serial = cue_->serial;
  const PlaylistPlace place = cue_->place;
  const uint64_t frame = cue_->frame;
  lock.unlock();
  Attempt attempt = try_open(place.list->items[place.index], frame);
  lock.lock();
  if (!cue_ || cue_->serial != serial) return locked_discard(attempt.item);
  cue_->item = std::move(attempt.item);
  if (cue_->item) return;
  const JumpDone done = std::move(cue_->done);
  cue_.reset();
  lock.unlock();
  done(&*attempt.error);
  lock.lock();
}

/// Reports a cued item as soon as frames of it are decoded. Its source decodes on threads of its
/// own.
void ItemLoader::look_at_cued(Lock& lock) {
  frames::FrameSource& source = *cue_->item->opened.source;
  source.service();
  cue_look_at_ = SteadyClock::now() + kSoon;
  cue_->decoded = source.saturated() || source.ready_count() > 0;
  const bool gives_up = SteadyClock::now() - cue_->since > kLongestDecoding;
  if (!cue_->decoded && !gives_up) return;
  const JumpDone done = std::move(cue_->done);
  const Error error(ErrorKind::Input, cue_->item->item.source.text + ": no frame arrived");
  if (gives_up && !cue_->decoded) {
    locked_discard(cue_->item);
    cue_.reset();
  }
  const bool decoded = cue_.has_value();
  lock.unlock();
  done(decoded ? nullptr : &error);
  lock.lock();
}

/// Finds the item in the list that is played now. Returns false if that list does not have it.
bool ItemLoader::locked_follow_list(JumpRequest& cue) const {
  const auto& list = cursor_.interrupted() ? cursor_.interrupted()->list : cursor_.list();
  if (list == cue.place.list) return true;
  const PlaylistItem& item = cue.item->item;
  const auto& items = list->items;
  const auto same = cue.place.index < items.size() && items[cue.place.index] == item
                        ? items.begin() + static_cast<ptrdiff_t>(cue.place.index)
                        : std::find(items.begin(), items.end(), item);
  if (same == items.end()) return false;
  cue.place.list = list;
  cue.place.index = static_cast<size_t>(same - items.begin());
  return true;
}

void ItemLoader::go(const JumpDone& done) {
  JumpDone replaced;
  try {
    const std::lock_guard lock(mutex_);
    if (ended_) throw about_to_end();
    if (!cue_) throw Error(ErrorKind::Failed, "go: no item is cued", "cue one first: cue SOURCE");
    if (!cue_->decoded)
      throw Error(ErrorKind::Failed, "go: the cued item is not decoded yet",
                  "wait for the answer to 'cue'");
    if (cue_->in_present_list && !locked_follow_list(*cue_))
      throw Error(ErrorKind::Failed, "go: the list was replaced and lacks the cued item",
                  "cue an item of the new list");
    JumpRequest request = std::move(*cue_);
    cue_.reset();
    request.item->list = request.place.list;
    request.item->index = request.place.index;
    request.item->rounds_done = request.place.rounds_done;
    request.item->interrupts = request.place.interrupts;
    request.done = done;
    request.since = SteadyClock::now();
    replaced = locked_request(std::move(request));
  } catch (const Error& error) {
    return done(&error);
  }
  wake_.signal();
  report_superseded(replaced);
}

std::string ItemLoader::cued() const {
  const std::lock_guard lock(mutex_);
  return cue_ ? cue_->place.list->items[cue_->place.index].source.text : std::string();
}

}  // namespace lenticule::player
