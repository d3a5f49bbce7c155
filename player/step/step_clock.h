// SPDX-License-Identifier: Apache-2.0
// StepClock is the clock by which the players of a group compare times: CLOCK_REALTIME at the start
// of the player, continued without its steps. chrony or PTP keep it right.
#pragma once

#include <chrono>
#include <cstdint>

namespace lenticule::player {

struct ClockReading {
  std::chrono::nanoseconds monotonic{0};
  std::chrono::nanoseconds real{0};
};
[[nodiscard]] ClockReading read_clocks() noexcept;

/// One moment, as messages and timelines need it.
struct StepNow {
  std::chrono::nanoseconds monotonic{0};
  std::chrono::nanoseconds group{0};    ///< time of the StepClock
  std::chrono::nanoseconds stepped{0};  ///< CLOCK_REALTIME less `group`
};

/// The kernel slews CLOCK_MONOTONIC and CLOCK_REALTIME alike, so their difference changes only when
/// CLOCK_REALTIME is stepped. A step is counted and reported to the peers, but moves no frame.
/// Thread safety: one thread.
class StepClock {
 public:
  explicit StepClock(const ClockReading& start) noexcept;
  StepNow now(const ClockReading& reading) noexcept;
  /// Returns the time of this clock less CLOCK_MONOTONIC.
  [[nodiscard]] std::chrono::nanoseconds ahead_of_monotonic() const noexcept { return ahead_; }
  [[nodiscard]] uint64_t steps() const noexcept { return steps_; }

 private:
  std::chrono::nanoseconds ahead_;
  std::chrono::nanoseconds stepped_{0};
  uint64_t steps_ = 0;
};

/// The accuracy of CLOCK_REALTIME as the kernel reports it, in microseconds (adjtimex(2)).
struct ClockAccuracy {
  bool known = false;         ///< the kernel answered
  bool synchronised = false;  ///< a service such as chrony disciplines the clock
  int64_t offset_us = 0;      ///< correction that is still being made
  int64_t estimated_us = 0;
  int64_t bound_us = 0;  ///< largest error
};
[[nodiscard]] ClockAccuracy read_clock_accuracy() noexcept;

}  // namespace lenticule::player
