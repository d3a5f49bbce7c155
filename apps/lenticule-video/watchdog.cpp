// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-video/watchdog.h"

#include <utility>

namespace lenticule::video {
namespace {

constexpr std::chrono::milliseconds kWait{100};

}  // namespace

Watchdog::Watchdog(std::chrono::milliseconds limit, std::function<void()> expired)
    : most_waits_(static_cast<int>(limit / kWait)),
      expired_(std::move(expired)),
      thread_([this] { count(); }) {}

Watchdog::~Watchdog() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stopped_.notify_all();
  thread_.join();
}

void Watchdog::watch(bool on) {
  const std::lock_guard lock(mutex_);
  watching_ = on;
  waits_ = 0;
}

void Watchdog::count() {
  std::unique_lock lock(mutex_);
  while (!stopped_.wait_for(lock, kWait, [this] { return stopping_; })) {
    if (!watching_ || ++waits_ <= most_waits_) continue;
    lock.unlock();
    expired_();
    return;
  }
}

Watchdog::Watch::Watch(Watchdog* watchdog) : watchdog_(watchdog) {
  if (watchdog_ != nullptr) watchdog_->watch(true);
}

Watchdog::Watch::~Watch() {
  if (watchdog_ != nullptr) watchdog_->watch(false);
}

}  // namespace lenticule::video
