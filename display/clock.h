// SPDX-License-Identifier: Apache-2.0
// The clock of a display, injected so that a display can also run in simulated time.
#pragma once

#include <atomic>
#include <memory>

#include "display/display.h"

namespace lenticule::display {

enum class WaitResult {
  Reached,  ///< the deadline is past
  Woken,    ///< the descriptor became readable before it
};

/// now() from any thread, wait_until() from one.
class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
  /// Waits until `deadline` or until `wake_fd` (or -1) is readable.
  [[nodiscard]] virtual WaitResult wait_until(Nanoseconds deadline, int wake_fd) noexcept = 0;
  /// False when time only passes by waiting.
  [[nodiscard]] virtual bool real_time() const noexcept = 0;
};

/// CLOCK_MONOTONIC, waited on with a timerfd. Throws Error(Failed) without one.
[[nodiscard]] std::shared_ptr<Clock> make_monotonic_clock();

/// Time that passes only by waiting, and then at once: a million vblanks take seconds.
class SimulatedClock final : public Clock {
 public:
  explicit SimulatedClock(Nanoseconds start = Nanoseconds{0}) : now_(start.count()) {}

  [[nodiscard]] Nanoseconds now() const noexcept override;
  [[nodiscard]] WaitResult wait_until(Nanoseconds deadline, int wake_fd) noexcept override;
  [[nodiscard]] bool real_time() const noexcept override { return false; }

  /// Lets time pass, as if somebody had worked for so long.
  void advance(Nanoseconds duration) noexcept;

 private:
  std::atomic<int64_t> now_;
};

}  // namespace lenticule::display
