// SPDX-License-Identifier: Apache-2.0
// Clock is the time of the server's timers, limits and records. A test replaces it by one of its
// own, and so lets a day pass in seconds.
#pragma once

#include <chrono>
#include <condition_variable>
#include <ctime>
#include <functional>
#include <mutex>

namespace lenticule::web {

/// Thread safety: any thread.
class Clock {
 public:
  using Time = std::chrono::steady_clock::time_point;
  virtual ~Clock() = default;

  [[nodiscard]] virtual Time now() const { return std::chrono::steady_clock::now(); }
  /// Returns seconds since 1970.
  [[nodiscard]] virtual int64_t date() const { return static_cast<int64_t>(std::time(nullptr)); }
  /// Waits until `condition` holds after a notification of `changed`, or until `end`.
  virtual void wait(std::condition_variable& changed, std::unique_lock<std::mutex>& lock, Time end,
                    const std::function<bool()>& condition) {
    changed.wait_until(lock, end, condition);
  }
  /// Returns how long a thread may wait for a descriptor when it has other work after `span`.
  [[nodiscard]] virtual std::chrono::milliseconds idle(std::chrono::milliseconds span) {
    return span;
  }
};

/// Returns the clock of the machine.
[[nodiscard]] inline Clock& machine_clock() {
  static Clock clock;
  return clock;
}

}  // namespace lenticule::web
