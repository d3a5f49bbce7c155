// SPDX-License-Identifier: Apache-2.0
// PendingFlip and TileEvents are the state of one page flip, without kernel calls.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "display/clock.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/scanout/active_output.h"
#include "display/kms/scanout/kms_output.h"

namespace lenticule::display {

// VblankClock counts the vblanks of one active output, by the driver's counter or, if the driver
// has none, by time. It assigns flips to vblanks and reports requested vblanks. VblankCounter is
// the arithmetic of that.

struct Vblank {
  uint64_t sequence = 0;
  Nanoseconds time{0};
};

/// Extends a driver's vblank counter to 64 bits, or derives the count from time. The count never
/// runs backwards, even if the driver's does. Thread safety: one thread.
class VblankCounter {
 public:
  enum class Source {
    Hardware,  ///< the driver's sequence numbers
    Software,  ///< time divided by period, for drivers without vblank counter
  };

  VblankCounter(Source source, frames::Rate refresh, Vblank now)
      : source_(source),
        refresh_(refresh),
        timeline_(now.time, refresh),
        base_(now.sequence),
        last_(now) {}

  [[nodiscard]] Source source() const { return source_; }
  /// Switches to counting by time.
  void use_software(Nanoseconds now) {
    if (source_ == Source::Software) return;
    last_ = last_until(now);
    source_ = Source::Software;
    anchor(last_);
  }
  /// Call when the driver's counter may have been reset: the next event continues from the current
  /// count.
  void rebase(Nanoseconds now) {
    if (source_ == Source::Hardware) rebasing_ = true;
    last_ = last_until(now);
    anchor(last_);
  }

  /// Extends the low 32 bits of a flip event. Corrects a sequence from the past and a zero or
  /// impossible timestamp.
  Vblank observe_low_bits(uint32_t sequence, Nanoseconds time, Nanoseconds now) {
    // Chooses the nearest 64-bit number with these low bits: within half of 2^32 in either
    // direction.
    const uint64_t known = driver_sequence(last_.sequence);
    const auto step = static_cast<int32_t>(sequence - static_cast<uint32_t>(known));
    return observe(rebasing_ ? sequence : known + static_cast<uint64_t>(int64_t{step}), time, now);
  }
  /// Does the same with the driver's 64-bit sequence, which needs no extension.
  Vblank observe(uint64_t driver_sequence, Nanoseconds time, Nanoseconds now) {
    if (rebasing_) {
      rebasing_ = false;
      offset_ = std::max(last_until(now).sequence, last_.sequence) - driver_sequence;
    }
    return accept(driver_sequence + offset_, time, now);
  }

  /// Returns the driver's number for the vblank `sequence` of this counter.
  [[nodiscard]] uint64_t driver_sequence(uint64_t sequence) const { return sequence - offset_; }

  /// Return, by the clock, the first vblank at or after `time`, and the last one at or before it.
  [[nodiscard]] Vblank first_from(Nanoseconds time) const {
    const Vblank before = last_until(time);
    return before.time >= time ? before : at(before.sequence + 1);
  }
  [[nodiscard]] Vblank last_until(Nanoseconds time) const {
    return at(base_ + timeline_.sequence_at(time));
  }
  [[nodiscard]] Vblank at(uint64_t sequence) const {
    if (sequence <= base_) return {sequence, timeline_.time_of(0)};
    return {sequence, timeline_.time_of(sequence - base_)};
  }
  [[nodiscard]] Nanoseconds period() const { return timeline_.period(); }
  [[nodiscard]] const Vblank& last() const { return last_; }

 private:
  /// A driver's timestamp may be that of the next active picture, or be reported late. A timestamp
  /// beyond these limits is not a time.
  static constexpr Nanoseconds kMostInFuture = std::chrono::milliseconds(50);
  static constexpr Nanoseconds kMostInPast = std::chrono::seconds(1);
  Vblank accept(uint64_t sequence, Nanoseconds time, Nanoseconds now) {
    const bool backwards = static_cast<int64_t>(sequence - last_.sequence) < 0;
    if (backwards) sequence = last_.sequence;
    if (time < now - kMostInPast || time > now + kMostInFuture || time < last_.time)
      time = std::clamp(at(sequence).time, last_.time, std::max(now, last_.time));
    last_ = {sequence, time};
    anchor(last_);
    return last_;
  }
  void anchor(Vblank vblank) {
    timeline_ = VblankTimeline(vblank.time, refresh_);
    base_ = vblank.sequence;
  }

  Source source_;
  frames::Rate refresh_;
  VblankTimeline timeline_;  ///< its vblank 0 is base_
  uint64_t base_;
  Vblank last_;
  uint64_t offset_ = 0;  ///< this counter's number minus the driver's
  bool rebasing_ = false;
};

/// Returns the timeout of a flip, less than the 250 ms after which a player assumes that a flip
/// completed.
[[nodiscard]] inline Nanoseconds flip_timeout(Nanoseconds period) noexcept {
  return std::max<Nanoseconds>(4 * period, std::chrono::milliseconds(200));
}

/// Thread safety: one thread. Lifetime: all arguments of the constructor must outlive the object.
class VblankClock {
 public:
  VblankClock(const KmsOutput& output, frames::Rate refresh, Clock& clock, KmsCounters& counters)
      : output_(output),
        clock_(clock),
        counters_(counters),
        counter_(first_count(output, refresh, clock.now())),
        last_flip_sequence_(counter_.last().sequence) {
    counters_.hardware_clock = is_hardware();
  }

  [[nodiscard]] bool is_hardware() const noexcept {
    return counter_.source() == VblankCounter::Source::Hardware;
  }
  [[nodiscard]] Nanoseconds period() const noexcept { return counter_.period(); }
  /// Call after a modeset, which may reset the driver's counter.
  void rebase() { counter_.rebase(clock_.now()); }

  /// The vblank of a flip, and the time when the flip may be reported: immediately for the driver's
  /// counter, at the vblank's time otherwise. Two flips never share a vblank, even if the driver
  /// reports that.
  struct Landing {
    Vblank vblank{};
    Nanoseconds report_at{0};
  };
  [[nodiscard]] Landing place(const DrmEvent& flip) noexcept {
    watch_sequences(flip.sequence);
    const Nanoseconds now = clock_.now();
    if (is_hardware())
      return place_at(
          counter_.observe_low_bits(static_cast<uint32_t>(flip.sequence), flip.time, now));
    const bool plausible = flip.time > now - flip_timeout(period()) && flip.time <= now;
    return place_at(counter_.first_from(plausible ? flip.time : now));
  }
  /// Returns the landing of a flip that was completed by a blocking commit, without an event.
  [[nodiscard]] Landing place_now() noexcept { return place_at(counter_.first_from(clock_.now())); }

  /// Requests the first vblank after `sequence`. The driver's event, if the driver is asked,
  /// carries `serial`. While the output is off the driver does not count, so time is used instead.
  void request(uint64_t sequence, uint64_t serial, bool may_ask_driver) noexcept {
    const Nanoseconds now = clock_.now();
    const uint64_t target = std::max(sequence + 1, counter_.last_until(now).sequence);
    if (tick_.phase == Tick::Phase::Awaited && tick_.sequence == target)
      return;  // already requested
    tick_ = {.phase = Tick::Phase::Timed,
             .sequence = target,
             .serial = serial,
             .due = counter_.at(target).time,
             .vblank = {}};
    if (!is_hardware() || !may_ask_driver) return;
    if (output_.queue_sequence(counter_.driver_sequence(target), serial) != 0) return;
    tick_.phase = Tick::Phase::Awaited;
    tick_.due = std::max(tick_.due, now) + kTickTimeout;
  }
  /// Handles a vblank event; returns false if it was not requested.
  [[nodiscard]] bool observe(const DrmEvent& tick) noexcept {
    if (tick_.phase != Tick::Phase::Awaited || tick.id != tick_.serial) return false;
    tick_.vblank = counter_.observe(tick.sequence, tick.time, clock_.now());
    tick_.phase = Tick::Phase::Ready;
    return true;
  }
  /// Returns the time at which the requested vblank is overdue or, counted by time, reached; never
  /// without a request.
  [[nodiscard]] Nanoseconds due() const noexcept {
    const bool waiting = tick_.phase == Tick::Phase::Awaited || tick_.phase == Tick::Phase::Timed;
    return waiting ? tick_.due : kNever;
  }
  void run_timers() noexcept {
    const Nanoseconds now = clock_.now();
    if (now < due()) return;
    if (tick_.phase == Tick::Phase::Awaited) {
      ++counters_.lost_ticks;
      tick_.vblank = counter_.last_until(now);
    } else {
      tick_.vblank = counter_.at(tick_.sequence);
    }
    tick_.phase = Tick::Phase::Ready;
  }
  /// Returns the requested vblank once.
  [[nodiscard]] std::optional<Vblank> take_tick() noexcept {
    if (tick_.phase != Tick::Phase::Ready) return std::nullopt;
    tick_.phase = Tick::Phase::None;
    return tick_.vblank;
  }

 private:
  static constexpr int kSameSequencesBeforeSoftware = 2;
  static constexpr Nanoseconds kTickTimeout = std::chrono::milliseconds(200);

  static VblankCounter first_count(const KmsOutput& output, frames::Rate refresh, Nanoseconds now) {
    using enum VblankCounter::Source;
    uint64_t sequence = 0;
    Nanoseconds time{0};
    if (output.read_sequence(sequence, time) != 0) return {Software, refresh, {0, now}};
    const bool plausible = time > Nanoseconds{0} && time <= now;
    return {Hardware, refresh, {sequence, plausible ? time : now}};
  }
  struct Tick {
    enum class Phase { None, Awaited, Timed, Ready };
    Phase phase = Phase::None;
    uint64_t sequence = 0;
    uint64_t serial = 0;
    Nanoseconds due{0};
    Vblank vblank{};
  };
  /// Detects drivers that do not count: two flips cannot happen in the same vblank.
  void watch_sequences(uint64_t sequence) noexcept {
    same_sequences_ = sequence == last_driver_sequence_ ? same_sequences_ + 1 : 0;
    last_driver_sequence_ = sequence;
    if (same_sequences_ < kSameSequencesBeforeSoftware || !is_hardware()) return;
    counter_.use_software(clock_.now());
    counters_.hardware_clock = false;
  }
  [[nodiscard]] Landing place_at(Vblank vblank) noexcept {
    const uint64_t earliest = last_flip_sequence_ + 1;
    if (vblank.sequence < earliest)
      vblank = is_hardware() ? Vblank{earliest, vblank.time} : counter_.at(earliest);
    last_flip_sequence_ = vblank.sequence;
    return {.vblank = vblank, .report_at = is_hardware() ? clock_.now() : vblank.time};
  }

  const KmsOutput& output_;
  Clock& clock_;
  KmsCounters& counters_;
  VblankCounter counter_;
  Tick tick_;
  uint64_t last_flip_sequence_;
  uint64_t last_driver_sequence_ = 0;
  int same_sequences_ = 0;
};

/// PendingFlip is the state of the one flip that was accepted and not yet reported, and the time of
/// its next step. It makes no kernel calls. Thread safety: one thread.
class PendingFlip {
 public:
  static constexpr int kRefusalsBeforeStuck = 5;
  enum class Phase {
    None,
    Queued,  ///< waits to be committed when due
    Armed,   ///< committed; its event is awaited until due
    Stuck,   ///< waits to be shown by a blocking commit when due
    Landed,  ///< displayed; to be reported when due
  };

  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Returns the buffer; null without a flip.
  [[nodiscard]] KmsBuffer* buffer() const noexcept { return buffer_; }
  /// Returns the time of the next step; kNever without a flip.
  [[nodiscard]] Nanoseconds due() const noexcept { return due_; }
  [[nodiscard]] bool is_due(Phase phase, Nanoseconds now) const noexcept {
    return phase_ == phase && now >= due_;
  }
  /// Returns true if the flip is accepted and not displayed yet.
  [[nodiscard]] bool under_way() const noexcept {
    return phase_ == Phase::Queued || phase_ == Phase::Armed || phase_ == Phase::Stuck;
  }
  /// Returns true if the event with this number is the awaited one.
  [[nodiscard]] bool awaits(uint64_t serial) const noexcept {
    return phase_ == Phase::Armed && serial_ == serial;
  }

  /// None -> Queued, due at once. `id` is the caller's.
  void queue(KmsBuffer* buffer, uint64_t id) noexcept {
    *this = PendingFlip{};
    phase_ = Phase::Queued;
    buffer_ = buffer;
    id_ = id;
    due_ = Nanoseconds{0};
  }
  /// Back to None: the flip was not accepted after all.
  void withdraw() noexcept { *this = PendingFlip{}; }
  /// Queued -> Armed; the event will carry `serial`.
  void arm(uint64_t serial, Nanoseconds timeout_end) noexcept {
    phase_ = Phase::Armed;
    serial_ = serial;
    due_ = timeout_end;
    refusals_ = 0;
  }
  /// Tries again at `until` because the kernel was busy; changes to Stuck after too many refusals.
  void put_off(Nanoseconds until) noexcept {
    phase_ = ++refusals_ > kRefusalsBeforeStuck ? Phase::Stuck : Phase::Queued;
    due_ = until;
  }
  /// Queued, Armed or Stuck -> Stuck; no effect in other phases.
  void stick(Nanoseconds due) noexcept {
    if (!under_way()) return;
    phase_ = Phase::Stuck;
    due_ = due;
  }
  void land(Vblank vblank, Nanoseconds report_at) noexcept {
    phase_ = Phase::Landed;
    vblank_ = vblank;
    due_ = report_at;
  }

  struct Landed {
    KmsBuffer* buffer = nullptr;
    uint64_t id = 0;
    Vblank vblank{};
  };
  /// Landed -> None.
  [[nodiscard]] Landed deliver() noexcept {
    const Landed landed{.buffer = buffer_, .id = id_, .vblank = vblank_};
    *this = PendingFlip{};
    return landed;
  }

 private:
  Phase phase_ = Phase::None;
  KmsBuffer* buffer_ = nullptr;
  uint64_t id_ = 0;
  uint64_t serial_ = 0;
  Nanoseconds due_ = kNever;
  int refusals_ = 0;
  Vblank vblank_{};
};

/// TileEvents collects the events of one flip, of which each CRTC sends one. Thread safety: one
/// thread.
class TileEvents {
 public:
  explicit TileEvents(size_t tiles) : arrived_(tiles) {}

  /// Forgets the events of the previous flip.
  void start() noexcept {
    for (std::optional<DrmEvent>& event : arrived_) event.reset();
  }
  /// Adds the event of a tile. Returns false if that tile's event has arrived already.
  [[nodiscard]] bool add(size_t tile, const DrmEvent& event) noexcept {
    if (arrived_[tile]) return false;
    arrived_[tile] = event;
    return true;
  }
  [[nodiscard]] bool complete() const noexcept {
    return std::ranges::all_of(arrived_, [](const auto& event) { return event.has_value(); });
  }
  /// Returns the event of the first tile, which must have arrived.
  [[nodiscard]] const DrmEvent& first() const noexcept { return *arrived_.front(); }
  /// Returns the difference between the earliest and the latest vblank of a complete flip; 0 if the
  /// driver does not state times.
  [[nodiscard]] Nanoseconds skew() const noexcept {
    const auto [first, last] = std::ranges::minmax(
        arrived_, {}, [](const std::optional<DrmEvent>& event) { return event->time; });
    return first->time > Nanoseconds{0} ? last->time - first->time : Nanoseconds{0};
  }

 private:
  std::vector<std::optional<DrmEvent>> arrived_;
};

}  // namespace lenticule::display
