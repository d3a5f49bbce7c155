// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/watchdog.h"

#include <utility>

namespace lenticule::video {
namespace {

/// Interval of looking at the deadline, so that a watch need not wake the thread.
constexpr std::chrono::milliseconds kInterval{100};

}  // namespace

Watchdog::Watchdog(std::chrono::milliseconds limit, std::function<void()> expired)
    : limit_(limit), expired_(std::move(expired)), thread_([this] { look(); }) {}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stopped_.notify_all();
  thread_.join();
}

void Watchdog::set_deadline(std::optional<Clock::time_point> deadline) {
  const std::lock_guard lock(mutex_);
  deadline_ = deadline;
}

void Watchdog::look() {
  std::unique_lock lock(mutex_);
  while (!stopped_.wait_for(lock, kInterval, [this] { return stopping_; })) {
    if (!deadline_ || Clock::now() < *deadline_) continue;
    lock.unlock();
    expired_();
    return;
  }
}

Watchdog::Watch::Watch(Watchdog* watchdog) : watchdog_(watchdog) {
  if (watchdog_ != nullptr) watchdog_->set_deadline(Clock::now() + watchdog_->limit_);
}

Watchdog::Watch::~Watch() {
  if (watchdog_ != nullptr) watchdog_->set_deadline(std::nullopt);
}

}  // namespace lenticule::video
