// SPDX-License-Identifier: Apache-2.0
// Clock is the clock of a display. It is injected, so that a display can also run in simulated
// time.
#pragma once

#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <memory>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
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

inline constexpr int64_t kNanosecondsPerSecond = 1'000'000'000;

inline bool readable_now(int fd) noexcept {
  pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
  return fd >= 0 && poll(&entry, 1, 0) == 1 && entry.revents != 0;
}

/// Waits with a timerfd instead of a poll() timeout, to which the kernel adds up to 50 us of slack.
class MonotonicClock final : public Clock {
 public:
  MonotonicClock() : timer_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) {
    if (!timer_)
      throw failed_error("display clock: cannot create a timer: {}", std::strerror(errno))
          .remedy("raise the limit of open files");
  }

  [[nodiscard]] Nanoseconds now() const noexcept override {
    timespec time{};
    clock_gettime(CLOCK_MONOTONIC, &time);
    return Nanoseconds(time.tv_sec * kNanosecondsPerSecond + time.tv_nsec);
  }

  [[nodiscard]] WaitResult wait_until(Nanoseconds deadline, int wake_fd) noexcept override {
    if (deadline <= now()) return readable_now(wake_fd) ? WaitResult::Woken : WaitResult::Reached;
    arm(deadline);
    pollfd entries[2] = {{.fd = timer_.get(), .events = POLLIN, .revents = 0},
                         {.fd = wake_fd, .events = POLLIN, .revents = 0}};
    while (poll(entries, 2, -1) < 0 && errno == EINTR && now() < deadline) {
    }
    return wake_fd >= 0 && entries[1].revents != 0 ? WaitResult::Woken : WaitResult::Reached;
  }

  [[nodiscard]] bool real_time() const noexcept override { return true; }

 private:
  void arm(Nanoseconds deadline) const noexcept {
    itimerspec when{};
    when.it_value.tv_sec = deadline.count() / kNanosecondsPerSecond;
    when.it_value.tv_nsec = deadline.count() % kNanosecondsPerSecond;
    timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &when, nullptr);
  }

  UniqueFd timer_;
};

/// Returns CLOCK_MONOTONIC, waited on with a timerfd. Throws Error(Failed) if the timerfd cannot be
/// created.
[[nodiscard]] inline std::shared_ptr<Clock> make_monotonic_clock() {
  return std::make_shared<MonotonicClock>();
}

/// SimulatedClock advances only when a thread waits, and then immediately: a million vblanks take
/// seconds.
class SimulatedClock final : public Clock {
 public:
  explicit SimulatedClock(Nanoseconds start = Nanoseconds{0}) : now_(start.count()) {}

  [[nodiscard]] Nanoseconds now() const noexcept override {
    return Nanoseconds(now_.load(std::memory_order_acquire));
  }
  [[nodiscard]] WaitResult wait_until(Nanoseconds deadline, int wake_fd) noexcept override {
    if (readable_now(wake_fd)) return WaitResult::Woken;
    now_.store(std::max(now_.load(std::memory_order_relaxed), deadline.count()),
               std::memory_order_release);
    return WaitResult::Reached;
  }
  [[nodiscard]] bool real_time() const noexcept override { return false; }

  /// Advances the time, as if a computation had taken so long.
  void advance(Nanoseconds duration) noexcept { now_.fetch_add(duration.count()); }

 private:
  std::atomic<int64_t> now_;
};

// n * denominator * 1e9 exceeds 64 bits after minutes at odd refreshes.
__extension__ typedef unsigned __int128 Uint128;

inline Uint128 nanosecond_terms(frames::Rate refresh) {
  return Uint128{static_cast<uint64_t>(refresh.denominator)} * uint64_t{kNanosecondsPerSecond};
}

/// VblankTimeline computes when the vblanks of a display with a known refresh occur, with integers
/// only, so that the times do not drift.
/// Vblank n happens at origin + n * period, rounded down to a nanosecond. The period is stored as a
/// fraction: after 400 days the error is still below one nanosecond. Thread safety: any thread.
class VblankTimeline {
 public:
  /// Throws Error(Usage) if a term of the refresh exceeds kMaxTerm.
  VblankTimeline(Nanoseconds origin, frames::Rate refresh) : origin_(origin), refresh_(refresh) {
    if (refresh.numerator > kMaxTerm || refresh.denominator > kMaxTerm)
      throw usage_error("refresh {}: too many digits", frames::to_string(refresh))
          .remedy("write 60, 59.94 or 60000/1001");
  }

  /// Limit of a refresh's terms, as large as any pixel clock in hertz.
  static constexpr int64_t kMaxTerm = int64_t{1} << 32;

  [[nodiscard]] Nanoseconds time_of(uint64_t sequence) const noexcept {
    const Uint128 elapsed =
        Uint128{sequence} * nanosecond_terms(refresh_) / static_cast<uint64_t>(refresh_.numerator);
    return origin_ + Nanoseconds(static_cast<int64_t>(elapsed));
  }
  /// Returns the last vblank at or before `time`; 0 for times before the origin.
  // The largest n with floor(n * D / N) <= x is floor(((x + 1) * N - 1) / D).
  [[nodiscard]] uint64_t sequence_at(Nanoseconds time) const noexcept {
    if (time <= origin_) return 0;
    const auto elapsed = static_cast<uint64_t>((time - origin_).count());
    const Uint128 scaled = (Uint128{elapsed} + 1) * static_cast<uint64_t>(refresh_.numerator) - 1;
    return static_cast<uint64_t>(scaled / nanosecond_terms(refresh_));
  }
  /// Returns one refresh period, rounded down.
  [[nodiscard]] Nanoseconds period() const noexcept {
    return Nanoseconds(static_cast<int64_t>(nanosecond_terms(refresh_) /
                                            static_cast<uint64_t>(refresh_.numerator)));
  }

 private:
  Nanoseconds origin_;
  frames::Rate refresh_;
};

}  // namespace lenticule::display
