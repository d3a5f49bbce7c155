// SPDX-License-Identifier: Apache-2.0
#include "display/clock.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "base/error.h"
#include "base/unique_fd.h"

namespace lenticule::display {
namespace {

constexpr int64_t kNanosecondsPerSecond = 1'000'000'000;

bool readable_now(int fd) noexcept {
  pollfd entry{.fd = fd, .events = POLLIN, .revents = 0};
  return fd >= 0 && poll(&entry, 1, 0) == 1 && entry.revents != 0;
}

/// Waits with a timerfd instead of a poll() timeout, to which the kernel adds up to 50 us of slack.
class MonotonicClock final : public Clock {
 public:
  MonotonicClock() : timer_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)) {
    if (!timer_)
      throw Error(ErrorKind::Failed,
                  fmt::format("display clock: cannot create a timer: {}", std::strerror(errno)),
                  "raise the limit of open files");
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

}  // namespace

std::shared_ptr<Clock> make_monotonic_clock() {
  return std::make_shared<MonotonicClock>();
}

Nanoseconds SimulatedClock::now() const noexcept {
  return Nanoseconds(now_.load(std::memory_order_acquire));
}

WaitResult SimulatedClock::wait_until(Nanoseconds deadline, int wake_fd) noexcept {
  if (readable_now(wake_fd)) return WaitResult::Woken;
  now_.store(std::max(now_.load(std::memory_order_relaxed), deadline.count()),
             std::memory_order_release);
  return WaitResult::Reached;
}

void SimulatedClock::advance(Nanoseconds duration) noexcept {
  now_.fetch_add(duration.count());
}

}  // namespace lenticule::display
