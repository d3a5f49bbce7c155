// SPDX-License-Identifier: Apache-2.0
// The filling thread's half of PlaylistSource: hands out frames, changes items, jumps.
#include "player/playlist/playlist_source.h"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include "player/playback/play_statistics.h"

namespace lenticule::player {
namespace {

using frames::LentFrame;
using frames::PullStatus;
using SteadyClock = std::chrono::steady_clock;

/// Maximum number of item changes and skipped frames per call, so that a call stays short.
constexpr int kStepsPerPull = 64;
/// Remaining play time at which the next item is opened.
constexpr double kAheadSeconds = 10.0;
constexpr frames::Rate kStillRate{4, 1};
constexpr auto kLongestJump = std::chrono::seconds(30);
constexpr size_t kRemembered = 64;
constexpr size_t kMostDamagedItems = 1000;

UniqueFd checked(int fd) {
  if (fd >= 0) return UniqueFd(fd);
  throw Error(ErrorKind::Failed, fmt::format("playlist: no descriptor: {}", std::strerror(errno)),
              "raise the limit of open files");
}

bool is_still(const OpenedSource& opened) {
  return opened.source->frame_count() == uint64_t{1};
}

}  // namespace

PlaylistSource::PlaylistSource(std::shared_ptr<const Playlist> list, PlaylistSourceOptions options)
    : options_(std::move(options)),
      wake_(checked(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC))),
      poll_(checked(epoll_create1(EPOLL_CLOEXEC))),
      list_(std::move(list)) {
  lent_.reserve(kRemembered);
  epoll_event event{.events = EPOLLIN, .data = {.fd = wake_.get()}};
  if (epoll_ctl(poll_.get(), EPOLL_CTL_ADD, wake_.get(), &event) != 0) (void)checked(-1);
  status_.list = list_->name;
  status_.items = list_->items.size();
  worker_ = std::thread([this] { work(); });
}

PlaylistSource::~PlaylistSource() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  work_there_.notify_all();
  worker_.join();
  const Error ending(ErrorKind::Failed, "load: the player is ending");
  if (wish_ && wish_->done) wish_->done(&ending);
}

void PlaylistSource::wake_filler() const {
  (void)eventfd_write(wake_.get(), 1);
}

// --- frames ---------------------------------------------------------------------------------

PullStatus PlaylistSource::pull(LentFrame& out) {
  if (at_end_) return PullStatus::End;
  try_wish();
  if (in_hand_) {
    out = *std::exchange(in_hand_, std::nullopt);
    idle_ = false;
    return PullStatus::Ready;
  }
  for (int step = 0; step < kStepsPerPull; ++step) {
    if (!current_ && !enters_next()) return nothing_yet();
    const PullStatus status = pull_current(out);
    if (status != PullStatus::End) return status;
  }
  wake_filler();
  return PullStatus::NotYet;
}

/// Pulls from the current item. Returns End if the item was left or if more of it can be pulled.
PullStatus PlaylistSource::pull_current(LentFrame& out) {
  Play& play = *current_;
  if (is_over(play)) {
    leave_current();
    return PullStatus::End;
  }
  switch (first_frame_of(play, out)) {
    case PullStatus::Ready:
      hand_out(play, out);
      want_next_in_time();
      return PullStatus::Ready;
    case PullStatus::NotYet:
      idle_ = play.waits_for_renderer;
      want_next_in_time();
      if (play.pulled_this_round == 0 && is_outdated()) {
        leave_current();
        return PullStatus::End;
      }
      if (!waited_too_long(play)) return PullStatus::NotYet;
      break_current(fmt::format("no frame came for {} s", play.item.wait_s));
      return PullStatus::End;
    case PullStatus::End:
      if (play.waits_for_renderer) {
        idle_ = true;
        if (!waited_too_long(play) && !is_outdated()) return PullStatus::NotYet;
        leave_current();
      } else if (!goes_round(play)) {
        leave_current();
      }
      return PullStatus::End;
    case PullStatus::Failed:
      break;
  }
  break_current(play.opened.source->failure());
  return PullStatus::End;
}

/// Pulls the item's next frame, skipping frames before its first one. A frame of another size is a
/// failure.
PullStatus PlaylistSource::first_frame_of(Play& play, LentFrame& out) {
  frames::FrameSource& source = *play.opened.source;
  for (int step = 0; step < kStepsPerPull; ++step) {
    const PullStatus status = source.pull(out);
    if (status != PullStatus::Ready) return status;
    if (out.frame.geometry != options_.panel) {
      source.release(out.token);
      return PullStatus::Failed;
    }
    if (!play.skips_to_first || out.number >= play.first_frame) {
      play.skips_to_first = false;
      return PullStatus::Ready;
    }
    source.release(out.token);
  }
  wake_filler();
  return PullStatus::NotYet;
}

/// Returns the status when no item is current: either the list is over, or an item is awaited.
PullStatus PlaylistSource::nothing_yet() {
  const std::lock_guard lock(mutex_);
  at_end_ = ended_ = list_over_ && !wish_ && !next_ && !held_;
  if (at_end_) return PullStatus::End;
  idle_ = idle_ || held_ || nothing_for_now_ || broken_in_a_row_ > 0 || wish_.has_value();
  return PullStatus::NotYet;
}

void PlaylistSource::hand_out(Play& play, LentFrame& out) {
  idle_ = false;
  play.waits_for_renderer = false;
  play.waiting_since = SteadyClock::now();
  rate_ = rate_of(play);
  lent_.push_back({.token = next_token_, .inner = out.token, .play = &play});
  ++play.lent;
  ++play.pulled_this_round;
  out.token = next_token_++;
  out.item = play.number;
  count_damage(play);
  if (play.pulled++ > 0) return;
  {
    const std::lock_guard lock(mutex_);
    broken_in_a_row_ = 0;
    ++status_.started;
  }
  tell(PlaylistEvent::Kind::ItemStarted, play.item.source.text);
}

void PlaylistSource::release(uint64_t token) {
  const auto lent =
      std::find_if(lent_.begin(), lent_.end(), [&](const Lent& one) { return one.token == token; });
  LENTICULE_CHECK(lent != lent_.end());
  Play* const play = lent->play;
  play->opened.source->release(lent->inner);
  lent_.erase(lent);
  if (--play->lent > 0 || play == current_.get()) return;
  const auto retired = std::find_if(retired_.begin(), retired_.end(),
                                    [&](const auto& one) { return one.get() == play; });
  if (retired == retired_.end()) return;
  throw_away(std::move(*retired));
  retired_.erase(retired);
}

int PlaylistSource::max_lent() const {
  return current_ ? std::min(current_->opened.source->max_lent(), static_cast<int>(kRemembered))
                  : 2;
}

uint64_t PlaylistSource::ready_count() const {
  return current_ ? current_->opened.source->ready_count() : 0;
}

bool PlaylistSource::saturated() const {
  return current_ && current_->opened.source->saturated();
}

void PlaylistSource::service() {
  eventfd_t count = 0;
  (void)eventfd_read(wake_.get(), &count);
  if (current_) current_->opened.source->service();
  try_wish();
}

// --- item changes ---------------------------------------------------------------------------

frames::Rate PlaylistSource::rate_of(const Play& play) const {
  if (options_.rate) return *options_.rate;
  if (play.item.rate) return *play.item.rate;
  const auto own = play.opened.source->rate();
  if (own) return *own;
  return is_still(play.opened) ? kStillRate : display_rate_;
}

std::optional<uint64_t> PlaylistSource::frame_limit(const Play& play) const {
  const bool is_shown_for_a_while = play.item.still_s && is_still(play.opened);
  const auto seconds = is_shown_for_a_while ? play.item.still_s : play.item.duration_s;
  if (!seconds) return std::nullopt;
  const double frames = std::round(*seconds * rate_of(play).hertz());
  return static_cast<uint64_t>(std::max(1.0, frames));
}

/// Returns true if the item has reached its end. Standby has none: it continues until an item is
/// ready.
bool PlaylistSource::is_over(const Play& play) const {
  if (!play.index) return false;
  const auto limit = frame_limit(play);
  return limit && play.pulled >= *limit;
}

uint64_t PlaylistSource::loops_of(const Play& play) const {
  const std::lock_guard lock(mutex_);
  const bool is_the_list = list_->items.size() == 1 && play.index;
  return is_the_list ? list_->items.front().loops : play.item.loops;
}

bool PlaylistSource::next_is_there() const {
  const std::lock_guard lock(mutex_);
  return next_ != nullptr;
}

/// Handles the end of a round. Returns true if the same item continues or turned out to be broken.
bool PlaylistSource::goes_round(Play& play) {
  ++play.loops_done;
  const bool limited = frame_limit(play).has_value() && play.index;
  const uint64_t loops = loops_of(play);
  if (std::exchange(play.pulled_this_round, 0) == 0) {
    // The only item is a ring that plays forever: the next renderer may deliver frames.
    play.waits_for_renderer = is_alone(play) && loops == kForever && play.opened.loop_obstacle;
    if (!play.waits_for_renderer) break_current("it holds no frame");
    return true;
  }
  bool more = limited || loops == kForever || play.loops_done < loops;
  if (!play.index)
    more = !next_is_there();
  else if (!limited && loops == kForever)
    more = play.item.permitted(options_.local_time());
  if (!more || is_outdated()) return false;
  if (takes_replacement(play)) return true;
  if (play.opened.source->rewind()) {
    if (!is_still(play.opened)) tell(PlaylistEvent::Kind::Seam, play.item.source.text);
  } else if (play.opened.loop_obstacle && (limited || loops == kForever)) {
    play.waits_for_renderer = true;
  } else {
    break_current("it cannot be played again");
  }
  return true;
}

/// Returns true if the list was replaced by one that does not continue the current item.
bool PlaylistSource::is_outdated() const {
  const std::lock_guard lock(mutex_);
  return outdated_;
}

/// Switches, at a loop point, to the same item's new files if there are any.
bool PlaylistSource::takes_replacement(Play& play) {
  std::unique_ptr<Play> fresh;
  {
    const std::lock_guard lock(mutex_);
    if (!replacement_ || replacement_->number != play.number) return false;
    fresh = std::move(replacement_);
  }
  fresh->pulled = play.pulled;  // its play time continues
  fresh->loops_done = play.loops_done;
  const std::string source = play.item.source.text;
  leave_current();
  begin(std::move(fresh));
  tell(PlaylistEvent::Kind::Replaced, source);
  return true;
}

/// Returns true for a list of one, which waits for frames as long as its player does.
bool PlaylistSource::is_alone(const Play& play) const {
  return play.list->items.size() == 1 && !play.list->standby;
}

bool PlaylistSource::waited_too_long(Play& play) const {
  const std::chrono::duration<double> waited = SteadyClock::now() - play.waiting_since;
  return !is_alone(play) && waited.count() > play.item.wait_s;
}

void PlaylistSource::want_next_in_time() {
  if (next_asked_ || !current_) return;
  const Play& play = *current_;
  const auto count = play.opened.source->frame_count();
  const uint64_t loops = loops_of(play);
  std::optional<uint64_t> all = frame_limit(play);
  if (!all && count && loops != kForever && play.index) all = *count * loops;
  if (!all && loops == kForever && play.index) return;
  const double left =
      all ? static_cast<double>(*all - std::min(*all, play.pulled)) / rate_of(play).hertz() : 0.0;
  if (left > kAheadSeconds) return;
  next_asked_ = true;
  const std::lock_guard lock(mutex_);
  next_wanted_ = true;
  work_there_.notify_all();
}

bool PlaylistSource::enters_next() {
  std::unique_ptr<Play> play;
  {
    const std::lock_guard lock(mutex_);
    if (!next_ && !list_over_ && !next_wanted_) {
      next_wanted_ = true;
      work_there_.notify_all();
    }
    if (!next_) return false;
    if (next_->item.waits_until_primed && !next_->opened.source->saturated()) {
      idle_ = true;
      return false;
    }
    play = std::move(next_);
  }
  if (play->index && !play->item.permitted(options_.local_time())) {
    throw_away(std::move(play));
    return false;
  }
  begin(std::move(play));
  return true;
}

void PlaylistSource::begin(std::unique_ptr<Play> play) {
  play->number = next_number_++;
  play->waiting_since = SteadyClock::now();
  current_ = std::move(play);
  next_asked_ = false;
  watch(*current_, true);
  const std::lock_guard lock(mutex_);
  followed_ = {.number = current_->number,
               .item = current_->item,
               .files = current_->files,
               .seen = current_->files};
  outdated_ = false;
  if (replacement_) trash_.push_back(std::move(replacement_));
  status_.list = current_->list->name;
  status_.items = current_->list->items.size();
  status_.source = current_->item.source.text;
  status_.item = current_->index;
  status_.frames = current_->opened.source->frame_count();
  status_.rounds_done = current_->rounds_done;
  on_standby_ = !current_->index;
  began_.push_back({current_->number, current_->item.source.text, current_->index});
  if (began_.size() > kRemembered) began_.pop_front();
}

void PlaylistSource::leave_current() {
  if (!current_) return;
  watch(*current_, false);
  {
    const std::lock_guard lock(mutex_);
    followed_ = {};
  }
  count_damage(*current_);
  if (current_->damage.any())
    tell(PlaylistEvent::Kind::ItemDamaged, current_->item.source.text,
         damage_text(current_->damage));
  if (current_->lent > 0)
    retired_.push_back(std::move(current_));
  else
    throw_away(std::move(current_));
  current_.reset();
  const std::lock_guard lock(mutex_);
  on_standby_ = false;
}

/// Adds the damage found since the last call to the status.
void PlaylistSource::count_damage(Play& play) {
  const frames::FrameDamage now = play.opened.source->damage();
  const frames::FrameDamage before = std::exchange(play.damage, now);
  if (now == before) return;
  const frames::FrameDamage more{.damaged = now.damaged - before.damaged,
                                 .missing = now.missing - before.missing,
                                 .repeated = now.repeated - before.repeated};
  const std::lock_guard lock(mutex_);
  status_.damage += more;
  const bool known = status_.damaged_items.contains(play.item.source.text);
  if (known || status_.damaged_items.size() < kMostDamagedItems)
    status_.damaged_items[play.item.source.text] += more;
}

/// Leaves the item to the opening thread to close, because closing may take long.
void PlaylistSource::throw_away(std::unique_ptr<Play> play) {
  const std::lock_guard lock(mutex_);
  trash_.push_back(std::move(play));
  work_there_.notify_all();
}

void PlaylistSource::break_current(const std::string& why) {
  const std::string source = current_->item.source.text;
  leave_current();
  count_skipped(source, why.empty() ? "frames of another size than the panel" : why);
}

void PlaylistSource::watch(const Play& play, bool on) {
  const int fd = play.opened.source->wake_fd();
  if (fd < 0) return;
  epoll_event event{.events = EPOLLIN, .data = {.fd = fd}};
  (void)epoll_ctl(poll_.get(), on ? EPOLL_CTL_ADD : EPOLL_CTL_DEL, fd, &event);
}

// --- jumps ----------------------------------------------------------------------------------

/// Enters the target of a jump once its first frame is there; until then the old item continues.
void PlaylistSource::try_wish() {
  std::unique_ptr<Play> play;
  uint64_t serial = 0;
  SteadyTime since;
  {
    const std::lock_guard lock(mutex_);
    if (!wish_ || !wish_->play || at_end_) return;
    play = std::move(wish_->play);
    serial = wish_->serial;
    since = wish_->since;
  }
  play->opened.source->service();
  LentFrame first;
  switch (first_frame_of(*play, first)) {
    case PullStatus::Ready:
      return enter_wish(std::move(play), serial, first);
    case PullStatus::NotYet:
      if (SteadyClock::now() - since < kLongestJump)
        return keep_wish_waiting(std::move(play), serial);
      return fail_wish(std::move(play), serial, "no frame came");
    case PullStatus::End:
      return fail_wish(std::move(play), serial, "it holds no frame");
    case PullStatus::Failed:
      break;
  }
  const std::string why = play->opened.source->failure();
  fail_wish(std::move(play), serial, why.empty() ? "frames of another size" : why);
}

void PlaylistSource::keep_wish_waiting(std::unique_ptr<Play> play, uint64_t serial) {
  {
    const std::lock_guard lock(mutex_);
    if (wish_ && wish_->serial == serial) wish_->play = std::move(play);
  }
  if (play) throw_away(std::move(play));
}

void PlaylistSource::enter_wish(std::unique_ptr<Play> play, uint64_t serial, LentFrame first) {
  JumpDone done;
  {
    const std::lock_guard lock(mutex_);
    if (wish_ && wish_->serial == serial) {
      done = std::move(wish_->done);
      list_ = wish_->list;
      position_ = wish_->index ? wish_->index : position_;
      rounds_done_ = wish_->rounds_done;
      list_over_ = nothing_for_now_ = false;
      ++wish_serial_;  // discards the item being opened for the old place
      if (next_) trash_.push_back(std::move(next_));
      next_wanted_ = false;
      wish_.reset();
    }
  }
  if (!done) {
    play->opened.source->release(first.token);
    return throw_away(std::move(play));
  }
  if (in_hand_) release(std::exchange(in_hand_, std::nullopt)->token);
  leave_current();
  begin(std::move(play));
  ++cut_;
  hand_out(*current_, first);
  in_hand_ = first;
  want_next_in_time();
  done(nullptr);
}

void PlaylistSource::fail_wish(std::unique_ptr<Play> play, uint64_t serial,
                               const std::string& why) {
  const Error error(ErrorKind::Input, play->item.source.text + ": " + why);
  throw_away(std::move(play));
  JumpDone done;
  {
    const std::lock_guard lock(mutex_);
    if (!wish_ || wish_->serial != serial) return;
    done = std::move(wish_->done);
    wish_.reset();
    next_wanted_ = true;
    work_there_.notify_all();
  }
  done(&error);
}

}  // namespace lenticule::player
