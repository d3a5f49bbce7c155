// SPDX-License-Identifier: Apache-2.0
// Clock is the clock of a display. It is injected, so that a display can also run in simulated
// time.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "display/display.h"
#include "frames/rational.h"

namespace lenticule::display {

/// The value "never" for due times.
inline constexpr Nanoseconds kNever = Nanoseconds::max();

enum class WaitResult {
  Reached,  ///< the deadline has passed
  Woken,    ///< the descriptor became readable before the deadline
};

/// Thread safety: now() from any thread, wait_until() from one.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
  /// Waits until `deadline` or until `wake_fd` (or -1) is readable.
  [[nodiscard]] virtual WaitResult wait_until(Nanoseconds deadline, int wake_fd) noexcept = 0;
  /// Returns false if time passes only by waiting.
  [[nodiscard]] virtual bool real_time() const noexcept = 0;
};

/// Returns CLOCK_MONOTONIC, waited on with a timerfd. Throws Error(Failed) if the timerfd cannot be
/// created.
[[nodiscard]] std::shared_ptr<Clock> make_monotonic_clock();

/// SimulatedClock advances only when a thread waits, and then immediately: a million vblanks take
/// seconds.
class SimulatedClock final : public Clock {
 public:
  explicit SimulatedClock(Nanoseconds start = Nanoseconds{0}) : now_(start.count()) {}

  [[nodiscard]] Nanoseconds now() const noexcept override {
    return Nanoseconds(now_.load(std::memory_order_acquire));
  }
  [[nodiscard]] WaitResult wait_until(Nanoseconds deadline, int wake_fd) noexcept override;
  [[nodiscard]] bool real_time() const noexcept override { return false; }

  /// Advances the time, as if a computation had taken so long.
  void advance(Nanoseconds duration) noexcept { now_.fetch_add(duration.count()); }

 private:
  std::atomic<int64_t> now_;
};

/// VblankTimeline computes when the vblanks of a display with a known refresh occur, with integers
/// only, so that the times do not drift.
/// Vblank n happens at origin + n * period, rounded down to a nanosecond. The period is stored as a
/// fraction: after 400 days the error is still below one nanosecond. Thread safety: any thread.
class VblankTimeline {
 public:
  /// Throws Error(Usage) if a term of the refresh exceeds kMaxTerm.
  VblankTimeline(Nanoseconds origin, frames::Rate refresh);

  /// Limit of a refresh's terms, as large as any pixel clock in hertz.
  static constexpr int64_t kMaxTerm = int64_t{1} << 32;

  [[nodiscard]] Nanoseconds time_of(uint64_t sequence) const noexcept;
  /// Returns the last vblank at or before `time`; 0 for times before the origin.
  [[nodiscard]] uint64_t sequence_at(Nanoseconds time) const noexcept;
  /// Returns one refresh period, rounded down.
  [[nodiscard]] Nanoseconds period() const noexcept;

 private:
  Nanoseconds origin_;
  frames::Rate refresh_;
};

}  // namespace lenticule::display
