// SPDX-License-Identifier: Apache-2.0
// Watchdog acts when a call of a library does not return in time.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace lenticule::video {

/// Watchdog calls `expired` on a thread of its own when a Watch lasts longer than `limit`. Signals
/// would not do: FFmpeg repeats an interrupted poll(). The time is counted in short waits of that
/// thread, so that a machine that was suspended, or gives the process no time, does not count.
///
/// Thread safety: one thread makes watches, one at a time.
class Watchdog {
 public:
  /// `expired` should end the process; it is called at most once.
  Watchdog(std::chrono::milliseconds limit, std::function<void()> expired);
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  /// Watch limits the time of its scope. Lifetime: must not outlive the watchdog.
  class Watch {
   public:
    /// Watches nothing without a watchdog.
    explicit Watch(Watchdog* watchdog);
    ~Watch();
    Watch(const Watch&) = delete;
    Watch& operator=(const Watch&) = delete;

   private:
    Watchdog* watchdog_;
  };

 private:
  void watch(bool on);
  void count();

  const int most_waits_;
  const std::function<void()> expired_;
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool watching_ = false;
  int waits_ = 0;  ///< number of waits in the present watch
  bool stopping_ = false;
  std::thread thread_;  // last member: the thread uses everything above
};

}  // namespace lenticule::video
