// SPDX-License-Identifier: Apache-2.0
// PlaylistSource presents a playlist as one source of frames: it plays item after item, skips items
// that cannot be played, and can jump while it plays.
#pragma once

#include <fmt/format.h>
#include <sys/epoll.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "frames/frame_source.h"
#include "player/playlist/item_loader.h"

namespace lenticule::player {

/// All frames have the panel's size; an item of another size counts as broken. The source never
/// fails: if no item can be played, it plays the list's default, otherwise the last frame stays,
/// which is black before the first one.
///
/// Thread safety: FrameSource's functions run on one thread, the frame copier; damage() and the
/// functions of the second group run on any. The members belong to the frame copier, except loader_
/// and reporter_, which have locks of their own.
class PlaylistSource final : public frames::FrameSource {
 public:
  /// Throws Error(Failed) if no descriptor is left. Opens no item yet.
  PlaylistSource(std::shared_ptr<const Playlist> list, PlaylistSourceOptions options)
      : options_(std::move(options)),
        poll_(epoll_create1(EPOLL_CLOEXEC)),
        reporter_(*list, options_.on_event),
        loader_(std::move(list), options_, reporter_, wake_) {
    check(static_cast<bool>(poll_));
    acquired_.reserve(kMaxAcquired);
    boxes_.reserve((kMaxOverlays + 1) * options_.overlaid_panels().size());
    epoll_event event{.events = EPOLLIN, .data = {.fd = wake_.fd()}};
    check(epoll_ctl(poll_.get(), EPOLL_CTL_ADD, wake_.fd(), &event) == 0);
  }

  /// Opens the only item of a list on the calling thread, so that a list of one unplayable item
  /// fails at once; begins to look for the first item of other lists. Call it before anything is
  /// pulled. Throws the item's error.
  void open_first() {
    loader_.open_first();
    if (options_.longest_wait) give_up_at_ = SteadyClock::now() + *options_.longest_wait;
  }
  /// Sets the rate of items without one; call it before anything is pulled.
  void set_display_rate(frames::Rate rate) { display_rate_ = rate; }

  /// Starts a jump. Only one is pending at a time: a new jump replaces a pending one, which then
  /// fails.
  void jump(const Jump& jump, const JumpDone& done) { loader_.jump(jump, done); }
  /// Ends an interruption at once.
  void return_now(const JumpDone& done) { loader_.return_now(done); }
  /// Opens an item that go() shows. `done` is called when its first frames are decoded.
  void cue(const Jump& jump, const JumpDone& done) { loader_.cue(jump, done); }
  void go(const JumpDone& done) { loader_.go(done); }
  /// States the speed at which frames are taken, as a factor, so that items are opened early
  /// enough.
  void set_speed(double factor) { speed_.store(factor); }
  /// Sets the loops of the list, or of its only item; kForever is allowed. Takes effect at the next
  /// loop point.
  void set_loops(uint64_t loops) { loader_.set_loops(loops); }
  /// Prevents the list from ending while `held` is true: it is paused and may jump.
  void hold(bool held) { loader_.hold(held); }
  /// Checks the list and item for replaced files at once, and reads the list even if its file is
  /// the same.
  void look_again() { loader_.look_again(); }
  /// Shows an overlay over all items for so long, instead of an earlier one; null: no overlay.
  void show_over(std::shared_ptr<OverlaySet> live, std::optional<double> seconds) {
    const auto end =
        SteadyClock::now() + std::chrono::duration<double>(seconds.value_or(kUntilEnded));
    const std::lock_guard lock(live_mutex_);
    live_.swap(live);
    live_end_ = std::chrono::time_point_cast<SteadyClock::duration>(end);
  }
  /// Removes that overlay if its time is over. Returns true if it was there.
  [[nodiscard]] bool end_overlay() {
    const std::lock_guard lock(live_mutex_);
    return SteadyClock::now() >= live_end_ && std::exchange(live_, nullptr) != nullptr;
  }
  /// Returns the boxes of a frame that is not released. Thread safety: the frame copier.
  [[nodiscard]] std::span<const OverlayBox> boxes_over(const frames::AcquiredFrame& frame) {
    const auto acquired = std::ranges::find(acquired_, frame.token, &Acquired::token);
    LENTICULE_CHECK(acquired != acquired_.end());
    const OverlayMoment& moment = acquired->overlays;
    boxes_.clear();
    if (moment.set != nullptr) moment.set->draw(frame.frame, moment.due, moment.time, boxes_);
    if (moment.live) moment.live->draw(frame.frame, ~0U, moment.time, boxes_);
    return boxes_;
  }
  [[nodiscard]] PlaylistStatus status() const {
    PlaylistStatus status = reporter_.status();
    loader_.complete(status);
    return status;
  }
  /// Returns the list that is played.
  [[nodiscard]] std::shared_ptr<const Playlist> list() const { return loader_.list(); }
  /// Returns the account of the item's turn, if it is remembered.
  [[nodiscard]] std::optional<ItemAccount> account_of(uint32_t item) const {
    return reporter_.account_of(item);
  }

  [[nodiscard]] frames::FrameGeometry geometry() const override { return options_.panel; }
  [[nodiscard]] std::optional<frames::Rate> rate() const override { return rate_; }
  [[nodiscard]] std::optional<uint64_t> frame_count() const override { return std::nullopt; }
  [[nodiscard]] frames::PullStatus pull(frames::AcquiredFrame& out) override {
    const bool waits = current_ ? current_->is_placeholder() : idle_;
    if (waits && give_up_at_ && SteadyClock::now() >= *give_up_at_) at_end_ = true;
    if (at_end_) return PullStatus::End;
    try_arrival();
    if (in_hand_) {
      out = *std::exchange(in_hand_, std::nullopt);
      idle_ = false;
      ++frames_given_;
      return PullStatus::Ready;
    }
    for (int step = 0; step < kStepsPerPull; ++step) {
      if (!current_ && !enters_next()) return nothing_yet();
      const PullStatus status = pull_current(out);
      if (status == PullStatus::Ready) ++frames_given_;
      if (status != PullStatus::End) return status;
    }
    wake_.signal();
    return PullStatus::NotYet;
  }
  void release(uint64_t token) override {
    for (std::optional<KeptFrame>* kept : {&last_, &held_})
      if (*kept && (*kept)->frame.token == token) {
        (*kept)->is_released = true;
        return;
      }
    give_back(token);
  }
  [[nodiscard]] int max_acquired() const override {
    if (!current_) return 2;
    const int most = std::min(current_->opened.source->max_acquired(), int{kMaxAcquired});
    return std::min(most - (keeps_last_ && most > 1 ? 1 : 0),
                    held_ ? Transition::kMostAcquired : most);
  }
  [[nodiscard]] uint64_t ready_count() const override {
    return current_ ? current_->opened.source->ready_count() : 0;
  }
  [[nodiscard]] bool saturated() const override {
    return current_ && current_->opened.source->saturated();
  }
  [[nodiscard]] bool rewind() override { return false; }
  [[nodiscard]] int wake_fd() const override { return poll_.get(); }
  void service() override {
    wake_.drain();
    if (current_) current_->opened.source->service();
    try_arrival();
  }
  [[nodiscard]] std::string failure() const override { return {}; }
  [[nodiscard]] bool nothing_due() const override { return idle_; }
  [[nodiscard]] bool waits_for_others() const override {
    return !current_ || current_->opened.source->waits_for_others();
  }
  [[nodiscard]] uint64_t cut() const override { return cut_; }
  [[nodiscard]] frames::FrameDamage damage() const override { return reporter_.damage(); }

 private:
  using AcquiredFrame = frames::AcquiredFrame;
  using PullStatus = frames::PullStatus;
  using EventKind = PlaylistEvent::Kind;
  using SteadyClock = std::chrono::steady_clock;
  /// Maximum number of item changes and skipped frames per call, so that a call stays short.
  static constexpr int kStepsPerPull = 64;
  /// Remaining play time at which the next item is opened.
  static constexpr double kAheadSeconds = 10.0;

  static constexpr frames::Rate kStillRate{4, 1};
  static constexpr auto kLongestJump = std::chrono::seconds(30);
  static constexpr size_t kMaxAcquired = 64;

  static void check(bool done) {
    if (done) return;
    throw failed_error("playlist: cannot create a file descriptor: {}", std::strerror(errno))
        .remedy("raise the limit of open files");
  }
  struct Acquired {
    uint64_t token = 0;
    uint64_t inner = 0;  ///< token of the item's source, or of its transition
    OpenItem* item = nullptr;
    bool is_blended = false;
    OverlayMoment overlays{};
  };
  /// KeptFrame is needed for a transition, also when the frame copier has released it.
  struct KeptFrame {
    frames::AcquiredFrame frame;
    bool is_released = false;
  };

  // Frames.
  /// Pulls from the current item. Returns End if the item was left or if more of it can be pulled.
  [[nodiscard]] frames::PullStatus pull_current(frames::AcquiredFrame& out) {
    OpenItem& item = *current_;
    if (is_over(item)) {
      if (!takes_next_turn(item)) leave_current();
      return PullStatus::End;
    }
    switch (pull_from(item, out)) {
      case PullStatus::Ready:
        hand_out(item, out);
        want_next_in_time();
        return PullStatus::Ready;
      case PullStatus::NotYet:
        idle_ = item.waits_for_renderer || item.opened.live || item.opened.source->nothing_due();
        want_next_in_time();
        if (item.pulled_this_round == 0 && loader_.is_outdated()) {
          leave_current();
          return PullStatus::End;
        }
        if (!item.waited_too_long()) return PullStatus::NotYet;
        break_current(fmt::format("no frame arrived for {} s", item.item.wait_s));
        return PullStatus::End;
      case PullStatus::End:
        if (item.waits_for_renderer) {
          idle_ = true;
          if (!item.waited_too_long() && !loader_.is_outdated()) return PullStatus::NotYet;
          leave_current();
        } else if (!goes_round(item)) {
          if (takes_next_turn(item))
            loader_.wait_for_renderer(*current_, true);
          else
            leave_current();
        }
        return PullStatus::End;
      case PullStatus::Failed:
        break;
    }
    break_current(item.opened.source->failure());
    return PullStatus::End;
  }
  /// Pulls the item's next frame, skipping frames before its first one. A frame of another size is
  /// a failure.
  [[nodiscard]] frames::PullStatus pull_from(OpenItem& item, frames::AcquiredFrame& out) {
    frames::FrameSource& source = *item.opened.source;
    if (item.picture) {
      out = held_ ? *item.picture : *std::exchange(item.picture, std::nullopt);
      return PullStatus::Ready;
    }
    for (int step = 0; step < kStepsPerPull; ++step) {
      const PullStatus status = source.pull(out);
      if (status != PullStatus::Ready) return status;
      if (out.frame.geometry != options_.panel) {
        source.release(out.token);
        return PullStatus::Failed;
      }
      if (!item.skips_to_first || out.number >= item.first_frame) {
        item.skips_to_first = false;
        return PullStatus::Ready;
      }
      source.release(out.token);
    }
    wake_.signal();
    return PullStatus::NotYet;
  }
  /// Returns the status when no item is current: either the list is over, or an item is awaited.
  [[nodiscard]] frames::PullStatus nothing_yet() {
    const ItemLoader::Prospect prospect = loader_.prospect();
    at_end_ = prospect == ItemLoader::Prospect::Ended;
    if (at_end_) return PullStatus::End;
    idle_ = idle_ || prospect == ItemLoader::Prospect::Idle;
    return PullStatus::NotYet;
  }
  void hand_out(OpenItem& item, frames::AcquiredFrame& out) {
    idle_ = false;
    if (item.waits_for_renderer) loader_.wait_for_renderer(item, false);
    item.waiting_since = SteadyClock::now();
    // A still picture is blended at each refresh, in time that counts as its own.
    const bool stands = held_ && item.is_still();
    rate_ = stands && !options_.rate ? display_rate_ : rate_of(item);
    if (stands) item.picture = out;
    if (stands) item.blended_s += 1.0 / rate_->hertz();
    acquired_.push_back({.token = next_token_, .inner = out.token, .item = &item});
    if (held_) blend(item, out);
    ++item.acquired;
    item.pulled_this_round += stands ? 0 : 1;
    ++item.handed_out;
    item.last_number = out.number;
    out.token = next_token_++;
    out.item = item.number;
    acquired_.back().overlays = overlays_over(item);
    reporter_.count_damage(item);
    if (!item.is_placeholder()) give_up_at_.reset();
    drop(last_);
    if (keeps_last_) last_ = {.frame = out};
    const bool starts = item.handed_out == 1 && item.frames_pulled == 0;
    item.frames_pulled += stands ? 0 : 1;
    if (item.handed_out == 1) loader_.note_first_frame(item);
    if (starts && !item.is_placeholder()) reporter_.started(item);
  }
  /// Returns the overlays of the frame that was pulled, and reports those that begin or end.
  [[nodiscard]] OverlayMoment overlays_over(const OpenItem& item) {
    OverlayMoment moment{.set = item.overlays.get(), .time = options_.clock()};
    // A step of a transition of a still picture has begun at the end of the one before.
    const double still = item.blended_s - (item.picture ? 1.0 / rate_->hertz() : 0.0);
    const double frames =
        static_cast<double>(item.began_at + item.frames_pulled) / rate_of(item).hertz();
    if (moment.set != nullptr) moment.due = moment.set->due_at(still + frames);
    {
      const std::lock_guard lock(live_mutex_);
      if (SteadyClock::now() < live_end_) moment.live = live_;
    }
    if (item.handed_out > 1 && moment.same_overlays(shown_)) return moment;
    shown_ = moment;
    std::vector<std::string> words;
    if (moment.set != nullptr) moment.set->add_words(moment.due, words);
    if (moment.live) moment.live->add_words(~0U, words);
    reporter_.note_overlays(item.number, std::move(words));
    return moment;
  }
  void give_back(uint64_t token) {
    const auto acquired = std::find_if(acquired_.begin(), acquired_.end(),
                                       [&](const Acquired& one) { return one.token == token; });
    LENTICULE_CHECK(acquired != acquired_.end());
    OpenItem* const item = acquired->item;
    if (acquired->is_blended)
      item->transition->release(acquired->inner);
    else
      item->opened.source->release(acquired->inner);
    acquired_.erase(acquired);
    if (--item->acquired > 0 || item == current_.get()) return;
    const auto retired = std::find_if(retired_.begin(), retired_.end(),
                                      [&](const auto& one) { return one.get() == item; });
    if (retired == retired_.end()) return;
    loader_.close(std::move(*retired));
    retired_.erase(retired);
  }
  /// Replaces the acquired frame by the next step of the transition.
  void blend(OpenItem& item, frames::AcquiredFrame& out) {
    uint64_t steps = item.transition->steps(*rate_);
    // After the last step, a picture stays until whole periods of its own rate are left.
    const double seconds = item.picture ? item.seconds().value_or(0.0) : 0.0;
    // It lasts no longer than the item, or one round of a film.
    const uint64_t all = seconds > 0.0
                             ? static_cast<uint64_t>(std::llround(seconds * rate_->hertz()))
                             : item.opened.source->frame_count().value_or(steps);
    if (!item.picture || seconds > 0.0) steps = std::clamp<uint64_t>(all, 1, steps);
    const double left = std::max(0.0, seconds - static_cast<double>(steps) / rate_->hertz());
    const double rest = std::fmod(left, 1.0 / rate_of(item).hertz()) * rate_->hertz();
    Acquired& acquired = acquired_.back();
    acquired.inner = item.transition->blend(held_->frame.frame, item.handed_out, steps, out.frame);
    acquired.is_blended = true;
    if (!item.picture) item.opened.source->release(out.token);
    if (item.handed_out + 1 >= steps + static_cast<uint64_t>(std::lround(rest))) drop(held_);
  }
  void drop(std::optional<KeptFrame>& kept) {
    const auto gone = std::exchange(kept, std::nullopt);
    if (gone && gone->is_released) give_back(gone->frame.token);
  }

  // Changes of items.
  [[nodiscard]] bool enters_next() {
    ItemLoader::Offer offer = loader_.take_next();
    idle_ = idle_ || offer.primes;
    if (!offer.item) return false;
    if (offer.item->index && !offer.item->item.permitted(options_.local_time())) {
      loader_.close(std::move(offer.item));
      return false;
    }
    begin(std::move(offer.item));
    return true;
  }
  /// Returns true if the item has reached its end. Standby has none: it continues until an item is
  /// ready.
  [[nodiscard]] bool is_over(const OpenItem& item) const {
    if (!item.index || (held_ && item.picture)) return false;
    if (item.opened.live) return item.live_is_over();
    const auto limit = item.frame_limit(rate_of(item));
    return limit && item.frames_pulled >= *limit;
  }
  /// Handles the end of a round. Returns true if the same item continues or turned out to be
  /// broken.
  [[nodiscard]] bool goes_round(OpenItem& item) {
    ++item.loops_done;
    const bool limited = item.frame_limit(rate_of(item)).has_value() && item.index;
    const uint64_t loops = loader_.loops_of(item);
    if (std::exchange(item.pulled_this_round, 0) == 0) {
      // The only item is a ring that plays forever: the next renderer may deliver frames.
      const bool waits = item.is_alone() && loops == kForever && item.opened.loop_obstacle;
      loader_.wait_for_renderer(item, waits);
      if (!waits) break_current("it contains no frame");
      return true;
    }
    reporter_.loop_done(item);
    const SourceKind kind = item.item.source.kind;
    const bool is_film = kind == SourceKind::Video || kind == SourceKind::Sequence;
    if (is_film && item.is_still() && item.item.still_s && item.loops_done == 1)
      reporter_.report({.kind = EventKind::Still,
                        .source = item.item.source.text,
                        .detail = "it has only one frame"});
    bool more = limited || loops == kForever || item.loops_done < loops;
    if (!item.index)
      more = !loader_.next_is_there();
    else if (!limited && loops == kForever)
      more = item.item.permitted(options_.local_time());
    if (!more || loader_.is_outdated()) return false;
    if (takes_replacement(item)) return true;
    begin_sound(item);  // the number of loops may be another one
    if (item.opened.source->rewind()) {
      if (!item.is_still())
        reporter_.report({.kind = EventKind::LoopPoint, .source = item.item.source.text});
    } else if (item.opened.loop_obstacle && (limited || loops == kForever)) {
      loader_.wait_for_renderer(item, true);
    } else {
      break_current("it cannot be repeated");
    }
    return true;
  }
  /// Switches, at a loop point, to the same item's new files if there are any.
  [[nodiscard]] bool takes_replacement(const OpenItem& item) {
    std::unique_ptr<OpenItem> fresh = loader_.take_replacement(item.number);
    if (!fresh) return false;
    fresh->began_at = item.began_at;
    fresh->frames_pulled = item.frames_pulled;  // its play time continues
    fresh->loops_done = item.loops_done;
    const std::string source = item.item.source.text;
    leave_current();
    begin(std::move(fresh));
    reporter_.report({.kind = EventKind::Replaced, .source = source});
    return true;
  }
  [[nodiscard]] bool takes_next_turn(OpenItem& item) {
    if (!loader_.takes_next_turn(item)) return false;
    reporter_.end(item, true);
    item.frames_pulled = item.handed_out = item.pulled_this_round = item.loops_done = 0;
    item.returns = false;
    begin(std::move(current_));
    return true;
  }
  void begin(std::unique_ptr<OpenItem> item) {
    item->number = next_number_++;
    begin_sound(*item);
    item->begun = item->waiting_since = SteadyClock::now();
    if (last_ && item->transition)
      held_ = std::exchange(last_, std::nullopt);
    else
      item->transition.reset();
    current_ = std::move(item);
    keeps_last_ = current_->list->has_transitions();
    next_asked_ = false;
    watch(*current_, true);
    loader_.begin(*current_);
    reporter_.begin(*current_);
    if (current_->returns)
      reporter_.report({.kind = EventKind::Returned,
                        .source = current_->item.source.text,
                        .woven_elsewhere = current_->opened.woven_elsewhere});
  }
  void begin_sound(const OpenItem& item) const {
    if (item.opened.begin_sound)
      item.opened.begin_sound(item.number,
                              item.item.duration_s ? kForever : loader_.loops_of(item));
  }
  /// Leaves the item to the loader to be closed, once its frames are given back.
  void leave_current(bool to_end = true) {
    if (!current_) return;
    watch(*current_, false);
    loader_.leave();
    // An item of which no frame was shown is reported as left out.
    if (current_->handed_out > 0) {
      reporter_.count_damage(*current_);
      reporter_.report_damage(*current_);
    }
    reporter_.end(*current_, to_end);
    if (current_->picture) current_->opened.source->release(current_->picture->token);
    drop(held_);
    if (current_->acquired > 0)
      retired_.push_back(std::move(current_));
    else
      loader_.close(std::move(current_));
    current_.reset();
  }
  void break_current(const std::string& why) {
    const ItemLoader::Fault fault{.source = current_->item.source.text,
                                  .why = why.empty() ? "frame size differs from the panel's" : why,
                                  .standby = !current_->index,
                                  .played = current_->handed_out > 0,
                                  .loops_done = current_->loops_done};
    leave_current(false);
    loader_.skip(fault);
  }
  void want_next_in_time() {
    if (next_asked_ || !current_) return;
    const OpenItem& item = *current_;
    const auto count = item.opened.source->frame_count();
    const uint64_t loops = loader_.loops_of(item);
    std::optional<uint64_t> all = item.frame_limit(rate_of(item));
    if (!all && count && loops != kForever && item.index) all = *count * loops;
    if (!all && loops == kForever && item.index) return;
    const double left =
        all ? static_cast<double>(*all - std::min(*all, item.frames_pulled)) / rate_of(item).hertz()
            : 0.0;
    if (left > kAheadSeconds * speed_.load()) return;
    next_asked_ = true;
    loader_.want_next();
  }
  void watch(const OpenItem& item, bool on) const {
    const int fd = item.opened.source->wake_fd();
    if (fd < 0) return;
    epoll_event event{.events = EPOLLIN, .data = {.fd = fd}};
    (void)epoll_ctl(poll_.get(), on ? EPOLL_CTL_ADD : EPOLL_CTL_DEL, fd, &event);
  }
  [[nodiscard]] frames::Rate rate_of(const OpenItem& item) const {
    if (options_.rate) return *options_.rate;
    if (item.item.rate) return *item.item.rate;
    const auto own = item.opened.source->rate();
    if (own) return *own;
    return item.is_still() ? kStillRate : display_rate_;
  }

  // Jumps.
  /// Enters the target of a jump once its first frame is there; until then the old item continues.
  void try_arrival() {
    if (at_end_) return;
    auto arrival = loader_.take_arrival();
    if (!arrival) return;
    const PlaylistItem& item = arrival->item->item;
    const uint64_t frame = arrival->item->first_frame;
    frames::FrameSource& source = *arrival->item->opened.source;
    const auto fail = [&](const std::string& why) {
      loader_.fail(std::move(*arrival), Error(ErrorKind::Input, item.source.text + ": " + why));
    };
    source.service();
    AcquiredFrame first;
    switch (pull_from(*arrival->item, first)) {
      case PullStatus::Ready:
        return arrive(std::move(*arrival), first);
      case PullStatus::NotYet:
        if (SteadyClock::now() - arrival->since < kLongestJump)
          return loader_.put_back(std::move(*arrival));
        return fail("no frame arrived");
      case PullStatus::End: {
        const Error error = no_such_frame(item, frame, source.frame_count().value_or(0));
        return loader_.fail(std::move(*arrival), error);
      }
      case PullStatus::Failed:
        break;
    }
    const std::string why = source.failure();
    fail(why.empty() ? "frame size has changed" : why);
  }
  void arrive(ItemLoader::Arrival arrival, frames::AcquiredFrame first) {
    const ItemProgress leaving = current_ ? progress_of(*current_, frames_given_) : ItemProgress{};
    const JumpDone done = loader_.accept(arrival.serial, leaving);
    if (!done) {
      arrival.item->opened.source->release(first.token);
      return loader_.close(std::move(arrival.item));
    }
    if (in_hand_) release(std::exchange(in_hand_, std::nullopt)->token);
    leave_current(false);
    begin(std::move(arrival.item));
    ++cut_;
    hand_out(*current_, first);
    in_hand_ = first;
    want_next_in_time();
    done(nullptr);
  }

  const PlaylistSourceOptions options_;
  frames::Rate display_rate_{60, 1};
  WakeFd wake_;
  UniqueFd poll_;  ///< readable when wake_ or the current item's descriptor is

  std::unique_ptr<OpenItem> current_;
  std::vector<std::unique_ptr<OpenItem>> retired_;  ///< items with frames that are still borrowed
  std::vector<Acquired> acquired_;
  std::vector<OverlayBox> boxes_;
  OverlayMoment shown_;    ///< overlays of the newest frame
  std::mutex live_mutex_;  ///< guards the two members below
  std::shared_ptr<OverlaySet> live_;
  SteadyClock::time_point live_end_;
  std::optional<KeptFrame> last_;  ///< the last frame, in a list with transitions
  std::optional<KeptFrame> held_;  ///< during a transition: the last frame of the item before
  bool keeps_last_ = false;
  std::optional<frames::AcquiredFrame> in_hand_;  ///< first frame after a jump
  std::optional<frames::Rate> rate_;
  uint64_t next_token_ = 1;
  uint32_t next_number_ = 1;
  uint64_t frames_given_ = 0;  ///< frames that pull() has returned
  std::atomic<double> speed_{1.0};
  std::atomic<uint64_t> cut_{0};
  bool idle_ = false;
  bool at_end_ = false;
  bool next_asked_ = false;
  std::optional<std::chrono::steady_clock::time_point> give_up_at_;  ///< none once an item plays

  PlaylistReporter reporter_;
  ItemLoader loader_;  // last member: its thread uses wake_ and reporter_
};

}  // namespace lenticule::player
