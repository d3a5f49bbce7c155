// SPDX-License-Identifier: Apache-2.0
// VblankClock counts the vblanks of one active output, by the driver's counter or, if the driver
// has none, by time. It assigns flips to vblanks and reports requested vblanks. VblankCounter is
// the arithmetic of that.
#pragma once

#include <cstdint>
#include <optional>

#include "display/clock.h"
#include "display/kms/device/drm_events.h"
#include "display/kms/scanout/kms_output.h"

namespace lenticule::display {

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

  VblankCounter(Source source, frames::Rate refresh, Vblank now);

  [[nodiscard]] Source source() const { return source_; }
  /// Switches to counting by time.
  void use_software(Nanoseconds now);
  /// Call when the driver's counter may have been reset: the next event continues from the current
  /// count.
  void rebase(Nanoseconds now);

  /// Extends the low 32 bits of a flip event. Corrects a sequence from the past and a zero or
  /// impossible timestamp.
  Vblank observe_low_bits(uint32_t sequence, Nanoseconds time, Nanoseconds now);
  /// Does the same with the driver's 64-bit sequence, which needs no extension.
  Vblank observe(uint64_t driver_sequence, Nanoseconds time, Nanoseconds now);

  /// Returns the driver's number for the vblank `sequence` of this counter.
  [[nodiscard]] uint64_t driver_sequence(uint64_t sequence) const { return sequence - offset_; }

  /// Return, by the clock, the first vblank at or after `time`, and the last one at or before it.
  [[nodiscard]] Vblank first_from(Nanoseconds time) const;
  [[nodiscard]] Vblank last_until(Nanoseconds time) const {
    return at(base_ + timeline_.sequence_at(time));
  }
  [[nodiscard]] Vblank at(uint64_t sequence) const;
  [[nodiscard]] Nanoseconds period() const { return timeline_.period(); }
  [[nodiscard]] const Vblank& last() const { return last_; }

 private:
  Vblank accept(uint64_t sequence, Nanoseconds time, Nanoseconds now);
  void anchor(Vblank vblank);

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
[[nodiscard]] Nanoseconds flip_timeout(Nanoseconds period) noexcept;

/// Thread safety: one thread. Lifetime: all arguments of the constructor must outlive the object.
class VblankClock {
 public:
  VblankClock(const KmsOutput& output, frames::Rate refresh, Clock& clock, KmsCounters& counters);

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
  [[nodiscard]] Landing place(const DrmEvent& flip) noexcept;
  /// Returns the landing of a flip that was completed by a blocking commit, without an event.
  [[nodiscard]] Landing place_now() noexcept { return place_at(counter_.first_from(clock_.now())); }

  /// Requests the first vblank after `sequence`. The driver's event, if the driver is asked,
  /// carries `serial`. While the output is off the driver does not count, so time is used instead.
  void request(uint64_t sequence, uint64_t serial, bool may_ask_driver) noexcept;
  /// Handles a vblank event; returns false if it was not requested.
  [[nodiscard]] bool observe(const DrmEvent& tick) noexcept;
  /// Returns the time at which the requested vblank is overdue or, counted by time, reached; never
  /// without a request.
  [[nodiscard]] Nanoseconds due() const noexcept;
  void run_timers() noexcept;
  /// Returns the requested vblank once.
  [[nodiscard]] std::optional<Vblank> take_tick() noexcept;

 private:
  struct Tick {
    enum class Phase { None, Awaited, Timed, Ready };
    Phase phase = Phase::None;
    uint64_t sequence = 0;
    uint64_t serial = 0;
    Nanoseconds due{0};
    Vblank vblank{};
  };
  void watch_sequences(uint64_t sequence) noexcept;
  [[nodiscard]] Landing place_at(Vblank vblank) noexcept;

  const KmsOutput& output_;
  Clock& clock_;
  KmsCounters& counters_;
  VblankCounter counter_;
  Tick tick_;
  uint64_t last_flip_sequence_;
  uint64_t last_driver_sequence_ = 0;
  int same_sequences_ = 0;
};

}  // namespace lenticule::display
