// SPDX-License-Identifier: Apache-2.0
#include "player/playback/presenter.h"

#include <algorithm>
#include <utility>

namespace lenticule::player {
namespace {

using display::Nanoseconds;

}  // namespace

void VblankCount::restart(Nanoseconds period) noexcept {
  period_ = period;
  restarts_ = true;
}

/// The first event after the display came back gives the new offset; the elapsed time gives the
/// playback's number.
display::DisplayEvent VblankCount::in_our_count(display::DisplayEvent event) noexcept {
  if (std::exchange(restarts_, false) && last_time_ > Nanoseconds{0}) {
    const int64_t away = std::max<int64_t>(1, (event.time - last_time_) / period_);
    ahead_ = last_ + static_cast<uint64_t>(away) - event.sequence;
  }
  event.sequence += ahead_;
  return event;
}

void VblankCount::observe(const display::DisplayEvent& event) noexcept {
  last_ = std::max(last_, event.sequence);
  last_time_ = std::max(last_time_, event.time);
}

uint64_t VblankCount::first_after(Nanoseconds time) const noexcept {
  const Nanoseconds since = time - last_time_;
  if (since >= Nanoseconds{0}) return last_ + 1 + static_cast<uint64_t>(since / period_);
  return last_ - std::min(last_, static_cast<uint64_t>(-since / period_));
}

uint64_t VblankCount::display_number(uint64_t vblank) const noexcept {
  const auto theirs = static_cast<int64_t>(vblank - ahead_);
  return !restarts_ && theirs > 0 ? static_cast<uint64_t>(theirs) : 0;
}

namespace {

using display::DisplayEvent;
using display::EventKind;
using display::Nanoseconds;
using display::SubmitStatus;
using std::chrono::milliseconds;

/// Longest wait before the stop request is checked again.
constexpr Nanoseconds kLongestWait = milliseconds(100);
/// Longest wait of a turn, so that a turn shows that the thread works.
constexpr Nanoseconds kLongestTurn = std::chrono::seconds(1);
/// Real time that a working source is waited for in simulated time.
constexpr milliseconds kSourceTimeout{10'000};
/// A submission less than this before its vblank counts as late.
constexpr Nanoseconds kSubmitMargin = std::chrono::microseconds(1500);
/// The display is considered lost after this many consecutive flips without an event, or refusals.
constexpr int kMaxEventsLost = 8;
constexpr int kMaxRefusals = 64;

Nanoseconds period_of(frames::Rate refresh) {
  return Nanoseconds(static_cast<int64_t>(1e9 / refresh.hertz()));
}

}  // namespace

Presenter::Presenter(display::Display& display, FrameCopier& frame_copier,
                     PresenterStatistics& statistics, const PlaybackOptions& options)
    : display_(display),
      frame_copier_(frame_copier),
      statistics_(statistics),
      options_(options),
      vblanks_(period_of(display.mode().refresh)),
      pacer_(display.mode().refresh, display.mode().refresh, options.late),
      wanted_rate_(display.mode().refresh) {
  frame_copier_.wake_at_cuts(wake_);
}

void Presenter::set_paused(bool paused) noexcept {
  paused_.store(paused, std::memory_order_release);
  wake_.signal();
}

void Presenter::set_off(bool off) noexcept {
  off_wanted_.store(off, std::memory_order_release);
  wake_.signal();
}

void Presenter::set_speed(uint32_t permille) noexcept {
  speed_permille_.store(permille, std::memory_order_release);
  wake_.signal();
}

bool Presenter::time_next_cut() noexcept {
  int64_t none = 0;
  const int64_t now = std::max<int64_t>(1, display_.now().count());
  const bool asked = cut_asked_at_.compare_exchange_strong(none, now, std::memory_order_acq_rel);
  wake_.signal();
  return asked;
}

void Presenter::request_stop() noexcept {
  stopping_.store(true, std::memory_order_release);
  wake_.signal();
}

PlayOutcome Presenter::run() noexcept {
  if (!pacer_.started()) {
    prime();
    choose_rate();
  }
  play_on();
  statistics_.turn_ns.set(0);
  return outcome_.value_or(PlayOutcome::Stopped);
}

void Presenter::play_on() noexcept {
  while (!over()) {
    act();
    if (over()) break;
    const Nanoseconds event = awaited_by() + event_timeout();
    handle(display_.wait_event(std::min(event, display_.now() + kLongestTurn), wake_.fd()));
    publish();
  }
  land_pending_flip();
}

void Presenter::finish_statistics() noexcept {
  pacer_.finish(end_vblank_.value_or(vblanks_.last() + 1));
  if (options_.turns != nullptr) options_.turns->finish(vblanks_.last_time(), pacer_.counts());
  publish();
}

/// Resets what belonged to the lost display and keeps the displayed frame's accounting.
void Presenter::resume(uint64_t frame) noexcept {
  stopping_.store(false, std::memory_order_release);
  outcome_.reset();
  end_vblank_.reset();
  pending_.reset();
  starved_since_.reset();
  silent_since_.reset();
  tick_requested_ = rebuffering_ = false;
  shows_one_more_ = true;
  off_ = false;  // opening a display switches it on
  statistics_.off.set(0);
  events_lost_in_a_row_ = refused_in_a_row_ = 0;
  vblanks_.restart(period_of(display_.mode().refresh));
  statistics_.display_returns.add();
  const uint64_t expected = pacer_.frame();
  if (frame < expected)
    statistics_.frames_shown_again.add(expected - frame);
  else
    statistics_.frames_lost.add(frame - expected);
  first_frame_ = frame;
  if (!pacer_.started()) return;
  wanted_rate_ = content_wanted();
  pacer_.resume(wanted_rate_, display_.mode().refresh, frame);
  state_rate();
}

/// Waits until enough frames are ready to start: all requested, all possible, or those that arrived
/// within the timeout.
void Presenter::prime() noexcept {
  Nanoseconds begin = display_.now();
  std::optional<Nanoseconds> first_frame;
  while (!over()) {
    if (options_.filling == Filling::InPresenter) frame_copier_.pump(kSourceTimeout, true);
    frame_copier_.wake_at_next_change(wake_);
    const Nanoseconds now = display_.now();
    const bool over_already = frame_copier_.state() != FrameCopier::State::Running;
    if (frame_copier_.idle()) begin = now;
    starved_since_ = begin;
    if (frame_copier_.peek() != nullptr) {
      starved_since_.reset();
      if (!first_frame) first_frame = now;
      if (frame_copier_.primed() || now >= *first_frame + options_.prime_timeout) return;
    } else if (over_already) {
      outcome_ = PlayOutcome::SourceFailed;
    } else if (options_.stall_timeout && now >= begin + *options_.stall_timeout) {
      outcome_ = PlayOutcome::SourceStalled;
    }
    if (over()) return;
    handle(display_.wait_event(now + kLongestWait, wake_.fd()));
    publish();
  }
}

/// Returns the rate at which to play the content. A source may learn its rate only with its first
/// frame, and change it with any frame.
frames::Rate Presenter::content_wanted() const noexcept {
  const FilledFrame* const head = frame_copier_.peek();
  const auto own = options_.content || head == nullptr ? options_.content : head->rate;
  return scaled_rate(own.value_or(display_.mode().refresh),
                     speed_permille_.load(std::memory_order_acquire));
}

void Presenter::choose_rate() noexcept {
  const frames::Rate refresh = display_.mode().refresh;
  wanted_rate_ = content_wanted();
  pacer_ = Pacer(wanted_rate_, refresh, options_.late);
  if (first_frame_ > 0) pacer_.resume(wanted_rate_, refresh, first_frame_);
  state_rate();
}

void Presenter::state_rate() noexcept {
  statistics_.content_numerator.set(static_cast<uint64_t>(pacer_.content_rate().numerator));
  statistics_.content_denominator.set(static_cast<uint64_t>(pacer_.content_rate().denominator));
}

/// Decides what the next vblank shows, unless that is decided already.
void Presenter::act() noexcept {
  if (options_.filling == Filling::InPresenter) frame_copier_.pump(kSourceTimeout);
  if (pending_) return;
  follow_cut();
  const uint64_t target = next_reachable_vblank();
  if (!end_vblank_ && options_.vblanks && pacer_.started())
    if (target >= pacer_.first_vblank() + *options_.vblanks)
      end_vblank_ = pacer_.first_vblank() + *options_.vblanks;
  if (end_vblank_) return end_at_vblank(*end_vblank_, outcome_at_end_);
  if (is_off() || holds_still()) return request_vblank(vblanks_.last());
  if (timed_cut_ && target < *timed_cut_) return request_vblank(*timed_cut_ - 2);

  while (true) {
    discard_before(pacer_.frame());
    // Content that is much faster than the display: all filled frames were to be skipped.
    if (options_.filling == Filling::InPresenter && frame_copier_.peek() == nullptr)
      frame_copier_.pump(kSourceTimeout);
    follow_rate();
    follow_group();
    switch (pacer_.decide(target, head_is_ready())) {
      case PaceDecision::Submit:
        return submit(*frame_copier_.peek(), target);
      case PaceDecision::Later:
        return request_vblank(pacer_.due() - 2);
      case PaceDecision::Starved:
        return starve(target);
      case PaceDecision::Skip:
        break;
    }
  }
}

bool Presenter::head_is_ready() const noexcept {
  const FilledFrame* const head = frame_copier_.peek();
  if (head == nullptr || head->index != pacer_.frame()) return false;
  return !rebuffering_ || frame_copier_.primed();
}

void Presenter::discard_before(uint64_t index) noexcept {
  frame_copier_.skip_before(index);
  const FilledFrame* head = frame_copier_.peek();
  for (; head != nullptr && head->index < index; head = frame_copier_.peek()) discard_head();
}

void Presenter::discard_head() noexcept {
  display_.discard(frame_copier_.peek()->buffer);
  frame_copier_.pop();
  frame_copier_.buffer_freed();
}

/// Handles a discontinuity of the source: discards frames filled before it and starts a new
/// schedule with the first frame after it. Until then the displayed frame stays.
void Presenter::follow_cut() noexcept {
  const uint64_t cut = frame_copier_.cut();
  if (cut != cut_) {
    cut_ = cut;
    after_cut_ = shows_one_more_ = true;
    rebuffering_ = false;
    starved_since_.reset();
    pacer_.begin_epoch();
    const int64_t asked_at = cut_asked_at_.load(std::memory_order_acquire);
    if (asked_at > 0) timed_cut_ = vblanks_.first_after(Nanoseconds(asked_at)) + 1;
  }
  const FilledFrame* head = frame_copier_.peek();
  for (; head != nullptr && head->cut < cut_; head = frame_copier_.peek()) {
    discard_head();
    statistics_.frames_cut.add();
  }
  if (!after_cut_ || head == nullptr) return;
  after_cut_ = false;
  wanted_rate_ = content_wanted();
  pacer_.resume(wanted_rate_, display_.mode().refresh, head->index);
  state_rate();
}

/// Follows the rate of the next frame, because items of a list may have rates of their own, and the
/// speed.
void Presenter::follow_rate() noexcept {
  const FilledFrame* const head = frame_copier_.peek();
  if (head == nullptr || head->index != pacer_.frame()) return;
  const frames::Rate rate = content_wanted();
  if (rate == wanted_rate_) return;
  wanted_rate_ = rate;
  pacer_.change_rate(rate);
  state_rate();
}

/// Switches the output as requested. Returns true while it is off.
bool Presenter::is_off() noexcept {
  const bool wanted = off_wanted_.load(std::memory_order_acquire) && pacer_.started();
  if (wanted == off_ || !display_.set_power(!wanted)) return off_;
  off_ = wanted;
  statistics_.off.set(off_ ? 1 : 0);
  starved_since_.reset();
  pacer_.begin_epoch();
  return off_;
}

/// Moves the schedule towards that of the group, by a vblank at most.
void Presenter::follow_group() noexcept {
  const FilledFrame* const head = frame_copier_.peek();
  if (options_.step == nullptr || head == nullptr || head->index != pacer_.frame()) return;
  if (!pacer_.scheduled()) return;
  const double ideal =
      pacer_.vblanks_to_ideal(vblanks_.last()) * static_cast<double>(vblanks_.period().count());
  const double shift = options_.step->correction(
      {.frame = head->number,
       .index = head->index,
       .vblank = vblanks_.last() + 1,
       .due = vblanks_.last_time() + Nanoseconds(static_cast<int64_t>(ideal)),
       .period = vblanks_.period(),
       .rate = pacer_.content_rate()});
  if (shift != 0.0) options_.step->moved(pacer_.shift(shift));
}

bool Presenter::holds_still() noexcept {
  if (!paused_.load(std::memory_order_acquire) || shows_one_more_) return false;
  starved_since_.reset();
  pacer_.begin_epoch();
  return true;
}

void Presenter::submit(const FilledFrame& frame, uint64_t target) noexcept {
  const Nanoseconds now = display_.now();
  const uint64_t id = frame.index;
  const FilledFrame head = frame;
  switch (display_.submit(frame.buffer, id)) {
    case SubmitStatus::Accepted:
      break;
    case SubmitStatus::Busy:
      statistics_.busy.add();
      if (++refused_in_a_row_ >= kMaxRefusals) outcome_ = PlayOutcome::DisplayLost;
      return request_vblank(vblanks_.last());
    case SubmitStatus::Paused:
      pacer_.begin_epoch();
      return request_vblank(vblanks_.last());
    case SubmitStatus::Lost:
      outcome_ = PlayOutcome::DisplayLost;
      return;
  }
  const Nanoseconds margin = std::min(kSubmitMargin, vblanks_.period() / 4);
  const bool in_time = !pacer_.started() || now + margin <= vblanks_.time_of(target);
  if (!in_time) statistics_.late_submits.add();
  frame_copier_.pop();
  pacer_.submitted(target, in_time);
  pending_ = {.target = target,
              .id = id,
              .submitted = now,
              .number = head.number,
              .item = head.item,
              .cut = head.cut,
              .timed = timed_cut_.has_value()};
  timed_cut_.reset();
  shows_one_more_ = false;
  refused_in_a_row_ = 0;
  rebuffering_ = false;
  starved_since_.reset();
}

/// Handles a frame that is due and not ready: the displayed frame stays.
void Presenter::starve(uint64_t target) noexcept {
  const FrameCopier::State state = frame_copier_.state();
  if (state != FrameCopier::State::Running && frame_copier_.peek() == nullptr) {
    pacer_.end_of_sequence();
    const uint64_t end = std::max(pacer_.due(), target);
    return end_at_vblank(end, state == FrameCopier::State::Ended ? PlayOutcome::Finished
                                                                 : PlayOutcome::SourceFailed);
  }
  const Nanoseconds now = display_.now();
  if (frame_copier_.idle()) {
    starved_since_.reset();
    pacer_.begin_epoch();
  } else if (!starved_since_) {
    starved_since_ = now;
  }
  if (options_.stall_timeout && starved_since_ &&
      now >= *starved_since_ + *options_.stall_timeout) {
    outcome_ = PlayOutcome::SourceStalled;
    return;
  }
  if (frame_copier_.between_sequences()) pacer_.begin_epoch();
  rebuffering_ = options_.late == LatePolicy::Hold;
  frame_copier_.wake_at_next_change(wake_);
  if (head_is_ready()) wake_.signal();
  request_vblank(vblanks_.last());
}

/// Ends the playback at `vblank`; the displayed frame stays until then.
void Presenter::end_at_vblank(uint64_t vblank, PlayOutcome outcome) noexcept {
  end_vblank_ = vblank;
  outcome_at_end_ = outcome;
  if (vblanks_.last() >= vblank) {
    outcome_ = outcome;
    return;
  }
  request_vblank(vblank - 1);
}

void Presenter::request_vblank(uint64_t sequence) noexcept {
  if (!tick_requested_ || sequence != tick_after_) {
    tick_after_ = sequence;
    tick_expected_ = vblanks_.time_of(std::max(sequence, vblanks_.last()) + 1);
  }
  tick_requested_ = display_.request_vblank(vblanks_.display_number(sequence));
  if (!tick_requested_) outcome_ = PlayOutcome::DisplayLost;
}

void Presenter::handle(const DisplayEvent& event) noexcept {
  switch (event.kind) {
    case EventKind::Flip:
      return handle_flip(vblanks_.in_our_count(event));
    case EventKind::Vblank:
      tick_requested_ = false;
      return observe_vblank(vblanks_.in_our_count(event));
    case EventKind::Timeout:
      return handle_timeout();
    case EventKind::Lost:
      outcome_ = PlayOutcome::DisplayLost;
      return;
  }
}

void Presenter::handle_flip(const DisplayEvent& event) noexcept {
  if (!pending_ || pending_->id != event.id) {
    statistics_.stray_events.add();
    return;
  }
  if (!pacer_.started()) {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    statistics_.first_flip_ns.set(static_cast<uint64_t>(Nanoseconds(now).count()));
    statistics_.first_sequence.set(event.sequence);
    statistics_.first_vblank_ns.set(static_cast<uint64_t>(event.time.count()));
  }
  statistics_.submit_to_flip.record(event.time - pending_->submitted);
  observe_vblank(event);
  pacer_.flipped(event.sequence);
  frame_copier_.shown(pending_->id);
  const DisplayedPlace before = statistics_.displayed.read();
  if (before.frames > 0 && before.item != pending_->item) statistics_.left.publish(before);
  if (options_.step != nullptr) options_.step->shown(pending_->number, event.time);
  statistics_.displayed.publish({.frames = pacer_.counts().shown,
                                 .index = pending_->id,
                                 .item = pending_->item,
                                 .number = pending_->number});
  if (options_.turns != nullptr)
    options_.turns->flipped({.item = pending_->item,
                             .number = pending_->number,
                             .cut = pending_->cut,
                             .time = event.time},
                            pacer_.counts());
  events_lost_in_a_row_ = 0;
  end_flip();
}

void Presenter::end_flip() noexcept {
  if (pending_->timed) forget_next_cut();
  pending_.reset();
  frame_copier_.buffer_freed();
}

void Presenter::observe_vblank(const DisplayEvent& event) noexcept {
  silent_since_.reset();
  statistics_.wake.record(display_.now() - event.time);
  vblanks_.observe(event);
  statistics_.last_sequence.set(vblanks_.last());
  statistics_.last_vblank_ns.set(static_cast<uint64_t>(vblanks_.last_time().count()));
}

/// Handles a wait that ended without an event: either another thread woke the presenter, or an
/// event is missing. A flip without an event is assumed to have completed at its target; the next
/// event corrects the count.
void Presenter::handle_timeout() noexcept {
  wake_.drain();
  const Nanoseconds now = display_.now();
  const bool flip_lost = pending_ && now >= pending_->submitted + event_timeout();
  const bool tick_lost = !pending_ && tick_requested_ && now >= tick_expected_ + event_timeout();
  if ((flip_lost || tick_lost) && !silent_since_) silent_since_ = now;
  if (flip_lost) {
    statistics_.flip_timeouts.add();
    if (++events_lost_in_a_row_ >= kMaxEventsLost) outcome_ = PlayOutcome::DisplayLost;
    pacer_.flipped(pending_->target);
    end_flip();
  } else if (tick_lost) {
    statistics_.vblank_timeouts.add();
    tick_requested_ = false;
  }
}

/// Waits, before run() returns, until the last submitted buffer is displayed or the display does
/// not answer.
void Presenter::land_pending_flip() noexcept {
  while (pending_ && outcome_ != PlayOutcome::DisplayLost)
    handle(display_.wait_event(pending_->submitted + event_timeout(), -1));
}

uint64_t Presenter::next_reachable_vblank() const noexcept {
  return vblanks_.first_after(std::max(display_.now(), vblanks_.last_time()));
}

std::optional<Nanoseconds> Presenter::time_left() const noexcept {
  if (!options_.vblanks || !pacer_.started()) return std::nullopt;
  const uint64_t end = pacer_.first_vblank() + *options_.vblanks;
  const uint64_t next = next_reachable_vblank();
  return end > next ? static_cast<int64_t>(end - next) * vblanks_.period() : Nanoseconds{0};
}

/// Returns the time at which the awaited event should arrive.
Nanoseconds Presenter::awaited_by() const noexcept {
  if (pending_) return pending_->submitted;
  const Nanoseconds now = display_.now();
  return tick_requested_ ? std::max(tick_expected_, now) : now;
}

Nanoseconds Presenter::event_timeout() const noexcept {
  return std::max<Nanoseconds>(5 * vblanks_.period(), milliseconds(250));
}

void Presenter::publish() noexcept {
  const auto turn = std::chrono::steady_clock::now().time_since_epoch();
  const auto since = [now = display_.now()](const std::optional<Nanoseconds>& begin) {
    return begin ? static_cast<uint64_t>((now - *begin).count()) : 0;
  };
  // In simulated time the presenter waits for the source, which is no halt.
  if (options_.filling == Filling::OwnThread)
    statistics_.turn_ns.set(static_cast<uint64_t>(Nanoseconds(turn).count()));
  statistics_.starved_ns.set(frame_copier_.between_sequences() ? 0 : since(starved_since_));
  statistics_.silent_ns.set(since(silent_since_));
  statistics_.pace.publish(pacer_.counts());
}

}  // namespace lenticule::player
