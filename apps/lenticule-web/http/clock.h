// SPDX-License-Identifier: Apache-2.0
// Clock is the time of the server's timers, limits and records. A test replaces it by one of its
// own, and so lets a day pass in seconds.
#pragma once

#include <algorithm>
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

/// AnswerTime bounds what this thread does for one answer, however many requests and programs that
/// takes, so that the client gets a status before its connection ends.
class AnswerTime {
 public:
  using Milliseconds = std::chrono::milliseconds;

  explicit AnswerTime(Milliseconds time) { end_ = std::chrono::steady_clock::now() + time; }
  ~AnswerTime() { end_ = std::chrono::steady_clock::time_point::max(); }
  AnswerTime(const AnswerTime&) = delete;
  AnswerTime& operator=(const AnswerTime&) = delete;

  /// Returns `time`, or what is left of the answer's time if that is less.
  [[nodiscard]] static Milliseconds at_most(Milliseconds time) {
    const auto left = end_ - std::chrono::steady_clock::now();
    return std::clamp(std::chrono::ceil<Milliseconds>(left), Milliseconds(0), time);
  }

 private:
  inline static thread_local std::chrono::steady_clock::time_point end_ =
      std::chrono::steady_clock::time_point::max();
};

}  // namespace lenticule::web
