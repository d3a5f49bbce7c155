// SPDX-License-Identifier: Apache-2.0
// Presenter shows the right frame at every vblank: it takes filled buffers, submits them when the
// pacer says so, and records the vblank numbers that the display reports. Its loop neither throws
// nor allocates. play(), below, gives it and the frame copier a thread each, and supervises them.
#include "player/playback/playback.h"

#include <poll.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <utility>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "player/playback/frame_copier.h"

namespace lenticule::player {
namespace {

using display::DisplayEvent;
using display::EventKind;
using display::Nanoseconds;
using display::SubmitStatus;
using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

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

/// VblankCount counts the vblanks of a playback, through returns of the display, whose own count
/// then starts again.
/// Thread safety: one thread.
class VblankCount {
 public:
  explicit VblankCount(Nanoseconds period) : period_(period) {}

  /// Continues with a display that came back: the next event gives its count.
  void restart(Nanoseconds period) noexcept {
    period_ = period;
    restarts_ = true;
  }
  /// Converts the vblank number of an event to that of the playback.
  /// The first event after the display came back gives the new offset; the elapsed time gives the
  /// playback's number.
  [[nodiscard]] DisplayEvent in_our_count(DisplayEvent event) noexcept {
    if (std::exchange(restarts_, false) && last_time_ > Nanoseconds{0}) {
      const int64_t away = std::max<int64_t>(1, (event.time - last_time_) / period_);
      ahead_ = last_ + static_cast<uint64_t>(away) - event.sequence;
    }
    event.sequence += ahead_;
    return event;
  }
  /// Takes the vblank of an event in the playback's count.
  void observe(const DisplayEvent& event) noexcept {
    last_ = std::max(last_, event.sequence);
    last_time_ = std::max(last_time_, event.time);
  }

  [[nodiscard]] Nanoseconds period() const noexcept { return period_; }
  /// Returns the last vblank that was observed, and its time; 0 before the first.
  [[nodiscard]] uint64_t last() const noexcept { return last_; }
  [[nodiscard]] Nanoseconds last_time() const noexcept { return last_time_; }
  /// Returns the time at which a vblank is expected.
  [[nodiscard]] Nanoseconds time_of(uint64_t vblank) const noexcept {
    return last_time_ + static_cast<int64_t>(vblank - last_) * period_;
  }
  /// Returns the first vblank after `time`, which may lie before the last event.
  [[nodiscard]] uint64_t first_after(Nanoseconds time) const noexcept {
    const Nanoseconds since = time - last_time_;
    if (since >= Nanoseconds{0}) return last_ + 1 + static_cast<uint64_t>(since / period_);
    return last_ - std::min(last_, static_cast<uint64_t>(-since / period_));
  }
  /// Returns the display's number for a vblank; 0 while that is not known.
  [[nodiscard]] uint64_t display_number(uint64_t vblank) const noexcept {
    const auto theirs = static_cast<int64_t>(vblank - ahead_);
    return !restarts_ && theirs > 0 ? static_cast<uint64_t>(theirs) : 0;
  }

 private:
  Nanoseconds period_;
  uint64_t last_ = 0;
  Nanoseconds last_time_{0};
  uint64_t ahead_ = 0;  ///< the playback's number less the display's
  bool restarts_ = false;
};

/// Thread safety: the presenter's thread, except where noted.
class Presenter {
 public:
  /// Lifetime: all arguments must outlive the presenter.
  Presenter(display::Display& display, FrameCopier& frame_copier, PresenterStatistics& statistics,
            const PlaybackOptions& options)
      : display_(display),
        frame_copier_(frame_copier),
        statistics_(statistics),
        options_(options),
        vblanks_(period_of(display.mode().refresh)),
        pacer_(display.mode().refresh, display.mode().refresh, options.late),
        wanted_rate_(display.mode().refresh) {
    frame_copier_.wake_at_cuts(wake_);
  }

  /// Runs the playback. Returns DisplayLost as soon as the display reports that state.
  [[nodiscard]] PlayOutcome run() noexcept {
    if (!pacer_.started()) {
      prime();
      choose_rate();
    }
    play_on();
    statistics_.turn_ns.set(0);
    return outcome_.value_or(PlayOutcome::Stopped);
  }
  /// Prepares another run() after DisplayLost, once the display is back; it shows `frame` first.
  /// The vblank count is advanced by the elapsed time.
  /// Resets what belonged to the lost display and keeps the displayed frame's accounting.
  void resume(uint64_t frame) noexcept {
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
  /// Returns the time until the requested vblanks are over; none = no end.
  [[nodiscard]] std::optional<Nanoseconds> time_left() const noexcept {
    if (!options_.vblanks || !pacer_.started()) return std::nullopt;
    const uint64_t end = pacer_.first_vblank() + *options_.vblanks;
    const uint64_t next = next_reachable_vblank();
    return end > next ? static_cast<int64_t>(end - next) * vblanks_.period() : Nanoseconds{0};
  }
  /// Counts the last frame's vblanks. Call it once after the last run().
  void finish_statistics() noexcept {
    pacer_.finish(end_vblank_.value_or(vblanks_.last() + 1));
    if (options_.turns != nullptr) options_.turns->finish(vblanks_.last_time(), pacer_.counts());
    publish();
  }
  /// Completes the pending flip and ends run(). Thread safety: any thread.
  void request_stop() noexcept {
    stopping_.store(true, std::memory_order_release);
    wake_.signal();
  }
  /// Keeps the displayed frame, except that one frame is shown after every discontinuity of the
  /// source. Thread safety: any thread.
  void set_paused(bool paused) noexcept {
    paused_.store(paused, std::memory_order_release);
    wake_.signal();
  }
  /// Switches the output off between two flips, once the first frame has been shown, or on again.
  /// The vblanks in between count as held. Thread safety: any thread.
  void set_off(bool off) noexcept {
    off_wanted_.store(off, std::memory_order_release);
    wake_.signal();
  }
  /// Requests that the first frame after the next discontinuity of the source is shown at the
  /// second vblank from now, or as soon as it is ready after that. Returns false while an earlier
  /// request is not fulfilled. Thread safety: any thread.
  [[nodiscard]] bool time_next_cut() noexcept {
    int64_t none = 0;
    const int64_t now = std::max<int64_t>(1, display_.now().count());
    const bool asked = cut_asked_at_.compare_exchange_strong(none, now, std::memory_order_acq_rel);
    wake_.signal();
    return asked;
  }
  /// Withdraws that request. Thread safety: any thread.
  void forget_next_cut() noexcept { cut_asked_at_.store(0, std::memory_order_release); }
  /// Plays the content at this many thousandths of its rate, from the next frame on. Thread safety:
  /// any thread.
  void set_speed(uint32_t permille) noexcept {
    speed_permille_.store(permille, std::memory_order_release);
    wake_.signal();
  }

 private:
  struct PendingFlip {
    uint64_t target = 0;
    uint64_t id = 0;
    Nanoseconds submitted{0};
    uint64_t number = 0;
    uint32_t item = 0;
    uint64_t cut = 0;
    bool timed = false;  ///< fulfils time_next_cut()
  };

  void play_on() noexcept {
    while (!over()) {
      act();
      if (over()) break;
      const Nanoseconds event = awaited_by() + event_timeout();
      handle(display_.wait_event(std::min(event, display_.now() + kLongestTurn), wake_.fd()));
      publish();
      if (options_.sound != nullptr && options_.sound->advance)
        options_.sound->advance(display_.now());
    }
    hold_sound(true);
    land_pending_flip();
  }
  /// Waits until enough frames are ready to start: all requested, all possible, or those that
  /// arrived within the timeout.
  void prime() noexcept {
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
  [[nodiscard]] frames::Rate content_wanted() const noexcept {
    const FilledFrame* const head = frame_copier_.peek();
    const bool live = head != nullptr && head->captured_ns > 0;  // due at each vblank
    const auto own = live                                  ? std::nullopt
                     : options_.content || head == nullptr ? options_.content
                                                           : head->rate;
    return scaled_rate(own.value_or(display_.mode().refresh),
                       speed_permille_.load(std::memory_order_acquire));
  }
  void choose_rate() noexcept {
    const frames::Rate refresh = display_.mode().refresh;
    wanted_rate_ = content_wanted();
    pacer_ = Pacer(wanted_rate_, refresh, options_.late);
    if (first_frame_ > 0) pacer_.resume(wanted_rate_, refresh, first_frame_);
    state_rate();
  }
  void state_rate() noexcept {
    statistics_.content_numerator.set(static_cast<uint64_t>(pacer_.content_rate().numerator));
    statistics_.content_denominator.set(static_cast<uint64_t>(pacer_.content_rate().denominator));
  }
  /// Decides what the next vblank shows, unless that is decided already.
  void act() noexcept {
    if (options_.filling == Filling::InPresenter) frame_copier_.pump(kSourceTimeout);
    if (pending_) return;
    // Reads these before the cut: frames of before a jump are not shown once it is answered.
    const bool off = is_off(), paused = paused_.load(std::memory_order_acquire);
    follow_cut();
    const uint64_t target = next_reachable_vblank();
    if (!end_vblank_ && options_.vblanks && pacer_.started())
      if (target >= pacer_.first_vblank() + *options_.vblanks)
        end_vblank_ = pacer_.first_vblank() + *options_.vblanks;
    if (end_vblank_) return end_at_vblank(*end_vblank_, outcome_at_end_);
    hold_sound(off || paused);
    if (off || (paused && !shows_one_more_)) {
      starved_since_.reset();
      pacer_.begin_epoch();
      return request_vblank(vblanks_.last());
    }
    if (timed_cut_ && target < *timed_cut_) return request_vblank(*timed_cut_ - 2);
    keep_newest_live();

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
  void submit(const FilledFrame& frame, uint64_t target) noexcept {
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
    live_ = head.captured_ns > 0;
    if (live_) statistics_.capture_to_submit.record(now - Nanoseconds(head.captured_ns));
    pending_ = {.target = target,
                .id = id,
                .submitted = now,
                .number = head.number,
                .item = head.item,
                .cut = head.cut,
                .timed = timed_cut_.has_value()};
    // The sound of a new item is prepared before its first frame appears.
    if (pacer_.started() && (head.item != sound_.item || head.cut != sound_.cut))
      anchor_sound(*pending_, head.index,
                   vblanks_.time_of(target) - vblanks_.last_time() +
                       Nanoseconds(pacer_.scheduled() ? cadence_offset(target) : 0));
    timed_cut_.reset();
    shows_one_more_ = false;
    refused_in_a_row_ = 0;
    rebuffering_ = false;
    starved_since_.reset();
  }
  /// Handles a frame that is due and not ready: the displayed frame stays.
  void starve(uint64_t target) noexcept {
    const FrameCopier::State state = frame_copier_.state();
    if (state != FrameCopier::State::Running && frame_copier_.peek() == nullptr) {
      pacer_.end_of_sequence();
      const uint64_t end = std::max(pacer_.due(), target);
      return end_at_vblank(end, state == FrameCopier::State::Ended ? PlayOutcome::Finished
                                                                   : PlayOutcome::SourceFailed);
    }
    const Nanoseconds now = display_.now();
    if (frame_copier_.idle() || live_) {
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
  void end_at_vblank(uint64_t vblank, PlayOutcome outcome) noexcept {
    end_vblank_ = vblank;
    outcome_at_end_ = outcome;
    if (vblanks_.last() >= vblank) {
      outcome_ = outcome;
      return;
    }
    request_vblank(vblank - 1);
  }
  void discard_before(uint64_t index) noexcept {
    frame_copier_.skip_before(index);
    const FilledFrame* head = frame_copier_.peek();
    for (; head != nullptr && head->index < index; head = frame_copier_.peek()) discard_head();
  }
  void discard_head() noexcept {
    display_.discard(frame_copier_.peek()->buffer);
    frame_copier_.pop();
    frame_copier_.buffer_freed();
  }
  /// Handles a discontinuity of the source: discards frames filled before it and starts a new
  /// schedule with the first frame after it. Until then the displayed frame stays.
  void follow_cut() noexcept {
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
  /// Leaves out the filled live frames that a newer one replaces. A live frame is shown at once:
  /// the schedule begins anew with it.
  void keep_newest_live() noexcept {
    const FilledFrame* const head = frame_copier_.peek();
    if (head == nullptr || head->captured_ns == 0) return;
    for (; frame_copier_.filled() > 1; statistics_.frames_superseded.add()) discard_head();
    const uint64_t index = frame_copier_.peek()->index;
    if (index != pacer_.frame())
      pacer_.resume(display_.mode().refresh, display_.mode().refresh, index);
  }
  /// Follows the rate of the next frame, because items of a list may have rates of their own, and
  /// the speed.
  void follow_rate() noexcept {
    const FilledFrame* const head = frame_copier_.peek();
    if (head == nullptr || head->index != pacer_.frame()) return;
    const frames::Rate rate = content_wanted();
    if (rate == wanted_rate_) return;
    wanted_rate_ = rate;
    pacer_.change_rate(rate);
    state_rate();
  }
  /// Moves the schedule towards that of the group, by a vblank at most.
  void follow_group() noexcept {
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
  /// Switches the output as requested. Returns true while it is off.
  [[nodiscard]] bool is_off() noexcept {
    const bool wanted = off_wanted_.load(std::memory_order_acquire) && pacer_.started();
    if (wanted == off_ || !display_.set_power(!wanted)) return off_;
    off_ = wanted;
    statistics_.off.set(off_ ? 1 : 0);
    return off_;
  }
  [[nodiscard]] bool head_is_ready() const noexcept {
    const FilledFrame* const head = frame_copier_.peek();
    if (head == nullptr || head->index != pacer_.frame()) return false;
    return !rebuffering_ || frame_copier_.primed();
  }
  void request_vblank(uint64_t sequence) noexcept {
    if (!tick_requested_ || sequence != tick_after_) {
      tick_after_ = sequence;
      tick_expected_ = vblanks_.time_of(std::max(sequence, vblanks_.last()) + 1);
    }
    tick_requested_ = display_.request_vblank(vblanks_.display_number(sequence));
    if (!tick_requested_) outcome_ = PlayOutcome::DisplayLost;
  }

  void handle(const DisplayEvent& event) noexcept {
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
  void handle_flip(const DisplayEvent& event) noexcept {
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
    // The frame after the displayed one is due at its ideal time.
    anchor_sound(*pending_, pacer_.frame(), Nanoseconds(cadence_offset(vblanks_.last())));
    events_lost_in_a_row_ = 0;
    end_flip();
  }
  /// Returns the ideal time of the pacer's frame after a vblank, in nanoseconds.
  [[nodiscard]] int64_t cadence_offset(uint64_t vblank) const noexcept {
    return static_cast<int64_t>(pacer_.vblanks_to_ideal(vblank) *
                                static_cast<double>(vblanks_.period().count()));
  }
  /// States that frame `index` of the playback, of the flip's item, is due `after` the last vblank.
  void anchor_sound(const PendingFlip& flip, uint64_t index, Nanoseconds after) noexcept {
    if (options_.sound == nullptr) return;
    const auto due = static_cast<uint64_t>((vblanks_.last_time() + after).count());
    const frames::Rate rate = pacer_.content_rate();
    const bool begins = sound_.due_ns == 0 || flip.item != sound_.item || flip.cut != sound_.cut;
    if (begins) {
      sound_.round = sound_.round_frames = 0;
      sound_.begun_ns =
          index == flip.id ? due : static_cast<uint64_t>(vblanks_.last_time().count());
    } else if (flip.number < sound_number_) {
      ++sound_.round;
      // The last frame of a round may be dropped.
      sound_.round_frames = std::max(sound_.round_frames, sound_number_ + 1);
    }
    sound_number_ = flip.number;
    sound_.item = flip.item;
    sound_.number = flip.number + (index - flip.id);
    sound_.due_ns = due;
    sound_.cut = flip.cut;
    sound_.numerator = static_cast<uint64_t>(rate.numerator);
    sound_.denominator = static_cast<uint64_t>(rate.denominator);
    options_.sound->anchor.publish(sound_);
  }
  void hold_sound(bool held) noexcept {
    if (options_.sound == nullptr || sound_.held == (held ? 1U : 0U)) return;
    sound_.held = held ? 1 : 0;
    options_.sound->anchor.publish(sound_);
  }
  /// Handles a wait that ended without an event: either another thread woke the presenter, or an
  /// event is missing. A flip without an event is assumed to have completed at its target; the next
  /// event corrects the count.
  void handle_timeout() noexcept {
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
  void end_flip() noexcept {
    if (pending_->timed) forget_next_cut();
    pending_.reset();
    frame_copier_.buffer_freed();
  }
  void observe_vblank(const DisplayEvent& event) noexcept {
    silent_since_.reset();
    statistics_.wake.record(display_.now() - event.time);
    vblanks_.observe(event);
    statistics_.last_sequence.set(vblanks_.last());
    statistics_.last_vblank_ns.set(static_cast<uint64_t>(vblanks_.last_time().count()));
  }
  /// Waits, before run() returns, until the last submitted buffer is displayed or the display does
  /// not answer.
  void land_pending_flip() noexcept {
    while (pending_ && outcome_ != PlayOutcome::DisplayLost)
      handle(display_.wait_event(pending_->submitted + event_timeout(), -1));
  }

  [[nodiscard]] uint64_t next_reachable_vblank() const noexcept {
    return vblanks_.first_after(std::max(display_.now(), vblanks_.last_time()));
  }
  /// Returns the time at which the awaited event should arrive.
  [[nodiscard]] Nanoseconds awaited_by() const noexcept {
    if (pending_) return pending_->submitted;
    const Nanoseconds now = display_.now();
    return tick_requested_ ? std::max(tick_expected_, now) : now;
  }
  [[nodiscard]] Nanoseconds event_timeout() const noexcept {
    return std::max<Nanoseconds>(5 * vblanks_.period(), milliseconds(250));
  }
  [[nodiscard]] bool over() const noexcept {
    return outcome_.has_value() || stopping_.load(std::memory_order_acquire);
  }
  void publish() noexcept {
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

  display::Display& display_;
  FrameCopier& frame_copier_;
  PresenterStatistics& statistics_;
  const PlaybackOptions& options_;
  VblankCount vblanks_;
  Pacer pacer_;
  uint64_t first_frame_ = 0;  ///< not 0 if the display was lost before it showed a frame

  std::optional<PlayOutcome> outcome_;
  std::optional<uint64_t> end_vblank_;  ///< vblank at which playing ends
  PlayOutcome outcome_at_end_ = PlayOutcome::Finished;
  std::optional<PendingFlip> pending_;
  bool tick_requested_ = false;
  uint64_t tick_after_ = 0;       ///< vblank after which the requested tick is due
  Nanoseconds tick_expected_{0};  ///< time at which that tick is expected
  bool rebuffering_ = false;      ///< LatePolicy::Hold after an underrun
  std::optional<Nanoseconds> starved_since_;
  std::optional<Nanoseconds> silent_since_;  ///< first timeout since the last event
  frames::Rate wanted_rate_;  ///< rate of the next frame, before it is locked to the display
  uint64_t cut_ = 0;          ///< the source's discontinuity number that was handled last
  bool after_cut_ = false;    ///< waiting for the first frame after a discontinuity
  std::optional<uint64_t> timed_cut_;  ///< first vblank that may show the frame after a timed cut
  bool shows_one_more_ = true;         ///< shows one more frame although paused
  bool off_ = false;                   ///< the output is switched off
  bool live_ = false;                  ///< the last submitted frame came in live
  int events_lost_in_a_row_ = 0;
  int refused_in_a_row_ = 0;
  SoundAnchor sound_;
  uint64_t sound_number_ = 0;  ///< number of the frame that anchored the sound last

  WakeFd wake_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> paused_{false};
  std::atomic<bool> off_wanted_{false};
  std::atomic<uint32_t> speed_permille_{1000};
  std::atomic<int64_t> cut_asked_at_{0};  ///< display time of time_next_cut(); 0: none
};

namespace {

constexpr milliseconds kReportInterval{1000};
constexpr milliseconds kPowerPoll{5};
constexpr int kPresenterPriority =
    10;  // below the kernel's interrupt threads, above everything else

/// Returns true if the real-time priority was granted.
bool take_real_time_priority() noexcept {
  sched_param parameters{};
  parameters.sched_priority = kPresenterPriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0;
}

double measured_refresh_hz(const PresenterStatistics& statistics) {
  const uint64_t vblanks = statistics.last_sequence.get() - statistics.first_sequence.get();
  const uint64_t elapsed = statistics.last_vblank_ns.get() - statistics.first_vblank_ns.get();
  const bool known = statistics.first_vblank_ns.get() > 0 && vblanks > 0 && elapsed > 0;
  return known ? static_cast<double>(vblanks) * 1e9 / static_cast<double>(elapsed) : 0.0;
}

double first_frame_ms(const PresenterStatistics& statistics, SteadyClock::time_point started) {
  const uint64_t flip = statistics.first_flip_ns.get();
  if (flip == 0) return 0.0;
  const auto since = std::chrono::nanoseconds(flip) - started.time_since_epoch();
  return std::chrono::duration<double, std::milli>(since).count();
}

StageDelays stage_delays(const LiveStatistics& live) {
  const auto seconds = [](uint64_t ns) { return static_cast<double>(ns) * 1e-9; };
  const auto since = [&](uint64_t turn_ns) {
    const auto now = std::chrono::nanoseconds(SteadyClock::now().time_since_epoch());
    return turn_ns == 0 ? 0.0 : seconds(static_cast<uint64_t>(now.count()) - turn_ns);
  };
  return {.source = seconds(live.presenter.starved_ns.get()),
          .frame_copier = since(live.frame_copier.turn_ns.get()),
          .presenter = since(live.presenter.turn_ns.get()),
          .display = seconds(live.presenter.silent_ns.get()),
          .source_waits_for_others = live.frame_copier.waits_for_others.get() != 0};
}

void add_counters(const LiveStatistics& live, PlayReport& report) {
  const PresenterStatistics& presenter = live.presenter;
  report.real_time = presenter.real_time.get() != 0;
  report.off = presenter.off.get() != 0;
  report.item = presenter.displayed.read().item;
  report.pace = presenter.pace.read();
  report.delays = stage_delays(live);
  if (presenter.content_numerator.get() > 0)
    report.content_rate = {
        .numerator = static_cast<int64_t>(presenter.content_numerator.get()),
        .denominator = static_cast<int64_t>(presenter.content_denominator.get())};
  for (size_t k = 0; k < std::size(kPresenterCounters<Counter>); ++k)
    report.*kPresenterCounters<uint64_t>[k].second =
        (presenter.*kPresenterCounters<Counter>[k].second).get();
  report.refresh_measured_hz = measured_refresh_hz(presenter);
  report.capture_to_submit = presenter.capture_to_submit.summary();
  report.submit_to_flip = presenter.submit_to_flip.summary();
  report.wake = presenter.wake.summary();

  const FrameCopierStatistics& frame_copier = live.frame_copier;
  for (size_t k = 0; k < std::size(kFrameCopierCounters<Counter>); ++k)
    report.*kFrameCopierCounters<uint64_t>[k].second =
        (frame_copier.*kFrameCopierCounters<Counter>[k].second).get();
  report.ready_min = frame_copier.ready_min.get();
  const uint64_t samples = frame_copier.ready_samples.get();
  if (samples > 0)
    report.ready_avg =
        static_cast<double>(frame_copier.ready_sum.get()) / static_cast<double>(samples);
  report.copy = frame_copier.copy.summary();
}

/// Playback runs one playback: it owns the threads, watches over them and makes the reports.
class Playback {
 public:
  Playback(display::Display& display, frames::FrameSource& source, const PlaybackOptions& options)
      : display_(display),
        source_(source),
        options_(options),
        frame_copier_(source, display, statistics_.frame_copier, options),
        presenter_(display, frame_copier_, statistics_.presenter, options) {
    still_.source = options.source_name;
    still_.late = options.late;
    look_at_display();
    if (options.control != nullptr)
      options.control->attach(presenter_, frame_copier_, statistics_.presenter);
  }
  ~Playback() {
    end_threads();
    if (options_.control != nullptr) options_.control->detach();
  }

  /// Plays to the end, reconnecting the display whenever it is lost and can be reopened.
  [[nodiscard]] PlayResult run() {
    start_threads();
    while (true) {
      watch();
      end_threads();
      if (outcome_ != PlayOutcome::DisplayLost || !reconnects()) break;
      look_at_display();
      over_.drain();
      presenter_.resume(frame_copier_.begin_again());
      start_threads();
    }
    presenter_.finish_statistics();
    const bool failed = frame_copier_.state() == FrameCopier::State::Failed;
    return {.outcome = outcome_,
            .failure = failed ? frame_copier_.failure() : std::string(),
            .report = report_now(outcome_name(outcome_))};
  }

 private:
  void start_threads() {
    if (options_.filling == Filling::OwnThread)
      copier_thread_ = std::thread([this] { frame_copier_.run(); });
    presenter_thread_ = std::thread([this] {
      if (options_.real_time_priority && take_real_time_priority())
        statistics_.presenter.real_time.set(1);
      outcome_ = presenter_.run();
      over_.signal();
    });
  }
  /// Joins the threads; the outcome is final afterwards.
  void end_threads() noexcept {
    presenter_.request_stop();
    if (presenter_thread_.joinable()) presenter_thread_.join();
    frame_copier_.request_stop();
    if (copier_thread_.joinable()) copier_thread_.join();
  }
  /// Waits for the presenter's end; forwards the stop request and sends reports.
  void watch() {
    const int turns_fd = options_.turns != nullptr ? options_.turns->fd() : -1;
    pollfd entries[3] = {{.fd = over_.fd(), .events = POLLIN, .revents = 0},
                         {.fd = options_.stop_fd, .events = POLLIN, .revents = 0},
                         {.fd = turns_fd, .events = POLLIN, .revents = 0}};
    auto next_report = SteadyClock::now() + kReportInterval;
    while (true) {
      const auto left = std::chrono::ceil<milliseconds>(next_report - SteadyClock::now());
      (void)poll(entries, 3, static_cast<int>(std::max(milliseconds(0), left).count()));
      if (entries[0].revents != 0) return;
      if (entries[1].revents != 0) {
        presenter_.request_stop();
        entries[1].fd = -1;  // report the stop only once
      }
      if (entries[2].revents != 0 && options_.on_turn) options_.on_turn();
      if (SteadyClock::now() < next_report) continue;
      next_report = SteadyClock::now() + kReportInterval;
      if (options_.on_report) options_.on_report(report_now("playing"));
    }
  }
  /// Opens the lost display again. Returns false, with the outcome, if playback ends instead.
  [[nodiscard]] bool reconnects() {
    if (!options_.reconnect) return false;
    frame_copier_.forget_buffers();
    const PlayReport report = report_now(outcome_name(PlayOutcome::DisplayLost));
    const ReconnectResult result = options_.reconnect(
        {.report = report, .time_left = presenter_.time_left(), .serve_source = [this] {
           source_.service();
         }});
    if (result == ReconnectResult::TimeOver) outcome_ = PlayOutcome::Finished;
    if (result == ReconnectResult::Stopped) outcome_ = PlayOutcome::Stopped;
    return result == ReconnectResult::Reconnected;
  }
  /// Reads the display's mode; no other thread may use the display meanwhile.
  void look_at_display() {
    const display::DisplayMode& mode = display_.mode();
    still_.display = mode.name;
    still_.geometry = mode.geometry;
    still_.refresh = mode.refresh;
    still_.hardware_clock = mode.hardware_clock;
  }
  [[nodiscard]] PlayReport report_now(const char* outcome) const {
    PlayReport report = still_;
    report.outcome = outcome;
    add_counters(statistics_, report);
    report.first_frame_ms = first_frame_ms(statistics_.presenter, options_.started);
    report.memory = read_resident_memory();
    return report;
  }

  display::Display& display_;
  frames::FrameSource& source_;
  const PlaybackOptions& options_;
  LiveStatistics statistics_;
  FrameCopier frame_copier_;
  Presenter presenter_;
  PlayReport still_;  ///< constant fields
  WakeFd over_;       ///< readable when the presenter has finished
  PlayOutcome outcome_ = PlayOutcome::Stopped;
  std::thread copier_thread_;
  std::thread presenter_thread_;
};

void check_sizes(const display::Display& display, const frames::FrameSource& source,
                 const std::string& name) {
  const frames::FrameGeometry panel = display.mode().geometry;
  const frames::FrameGeometry frame = source.geometry();
  if (frame == panel) return;
  throw input_error("{}: frames of {}x{} pixels, but the display has {}x{}", name, frame.width,
                    frame.height, panel.width, panel.height)
      .remedy("woven frames fit one panel, pixel for pixel: render or weave them for this rig");
}

}  // namespace

void PlaybackControl::attach(Presenter& presenter, FrameCopier& frame_copier,
                             const PresenterStatistics& statistics) {
  const std::scoped_lock lock(copy_mutex_, mutex_);
  presenter_ = &presenter;
  frame_copier_ = &frame_copier;
  statistics_ = &statistics;
  presenter.set_paused(paused_);
  presenter.set_off(off_);
  presenter.set_speed(speed_permille_);
}

void PlaybackControl::detach() {
  const std::scoped_lock lock(copy_mutex_, mutex_);
  presenter_ = nullptr;
  frame_copier_ = nullptr;
  statistics_ = nullptr;
}

void PlaybackControl::pause(bool paused) {
  const std::lock_guard lock(mutex_);
  paused_ = paused;
  if (presenter_ != nullptr) presenter_->set_paused(paused);
}

bool PlaybackControl::paused() const {
  const std::lock_guard lock(mutex_);
  return paused_;
}

bool PlaybackControl::switch_output(bool on, milliseconds timeout) {
  {
    const std::lock_guard lock(mutex_);
    off_ = !on;
    if (presenter_ == nullptr) return false;
    presenter_->set_off(off_);
  }
  // Polled, because the presenter takes no lock to report anything.
  const auto deadline = SteadyClock::now() + timeout;
  while (is_off() == on && SteadyClock::now() < deadline) std::this_thread::sleep_for(kPowerPoll);
  return is_off() != on;
}

bool PlaybackControl::is_off() const {
  const std::lock_guard lock(mutex_);
  return statistics_ != nullptr && statistics_->off.get() != 0;
}

void PlaybackControl::set_speed(uint32_t permille) {
  const std::lock_guard lock(mutex_);
  speed_permille_ = permille;
  if (presenter_ != nullptr) presenter_->set_speed(permille);
}

uint32_t PlaybackControl::speed_permille() const {
  const std::lock_guard lock(mutex_);
  return speed_permille_;
}

bool PlaybackControl::time_next_cut() {
  const std::lock_guard lock(mutex_);
  return presenter_ == nullptr || presenter_->time_next_cut();
}

void PlaybackControl::forget_next_cut() {
  const std::lock_guard lock(mutex_);
  if (presenter_ != nullptr) presenter_->forget_next_cut();
}

DisplayedPlace PlaybackControl::displayed() const {
  const std::lock_guard lock(mutex_);
  return statistics_ != nullptr ? statistics_->displayed.read() : DisplayedPlace{};
}

LeftItem PlaybackControl::left_item(uint64_t item) const {
  const std::lock_guard lock(mutex_);
  if (statistics_ == nullptr) return {};
  const DisplayedPlace displayed = statistics_->displayed.read();
  if (displayed.frames > 0 && displayed.item == item)
    return {.still_displayed = true, .last = displayed};
  const DisplayedPlace left = statistics_->left.read();
  if (left.frames > 0 && left.item == item) return {.still_displayed = false, .last = left};
  return {};
}

bool PlaybackControl::copy_shown(frames::WovenFrame& into, size_t part) {
  const std::lock_guard lock(copy_mutex_);
  if (frame_copier_ == nullptr || displayed().frames == 0) return false;
  return frame_copier_->copy_shown(into, part, milliseconds(1000));
}

const char* outcome_name(PlayOutcome outcome) {
  constexpr const char* kNames[] = {"finished", "interrupted", "source failed", "source stalled",
                                    "display lost"};
  return kNames[static_cast<size_t>(outcome)];
}

PlayResult play(display::Display& display, frames::FrameSource& source,
                const PlaybackOptions& options) {
  check_sizes(display, source, options.source_name);
  return Playback(display, source, options).run();
}

}  // namespace lenticule::player
