// SPDX-License-Identifier: Apache-2.0
#include "player/process/detached_worker.h"

#include <pthread.h>
#include <sched.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>
#include <utility>

namespace lenticule::player {
namespace {

/// Gives this thread only the time that others leave. A refusal changes nothing but the speed.
void stay_in_background() noexcept {
  constexpr int kThisThread = 1;           // IOPRIO_WHO_PROCESS
  constexpr int kIdleDiskClass = 3 << 13;  // IOPRIO_CLASS_IDLE
  const sched_param parameters{};
  (void)pthread_setschedparam(pthread_self(), SCHED_IDLE, &parameters);
  (void)syscall(SYS_ioprio_set, kThisThread, 0, kIdleDiskClass);
}

}  // namespace

struct DetachedWorker::Shared {
  void work() noexcept;

  size_t most_jobs = 0;
  bool background = false;
  std::atomic<bool> ending{false};
  std::mutex mutex;  ///< guards the members below
  std::condition_variable changed;
  std::deque<Job> jobs;
  bool busy = false;
};

void DetachedWorker::Shared::work() noexcept {
  if (background) stay_in_background();
  std::unique_lock lock(mutex);
  while (true) {
    changed.wait(lock, [this] { return ending.load() || !jobs.empty(); });
    if (ending.load()) return;
    const Job job = std::move(jobs.front());
    jobs.pop_front();
    busy = true;
    lock.unlock();
    job(ending);
    lock.lock();
    busy = false;
    changed.notify_all();
  }
}

DetachedWorker::DetachedWorker(size_t most_jobs, bool background)
    : shared_(std::make_shared<Shared>()) {
  shared_->most_jobs = most_jobs;
  shared_->background = background;
  std::thread([shared = shared_] { shared->work(); }).detach();
}

DetachedWorker::~DetachedWorker() {
  const std::lock_guard lock(shared_->mutex);
  shared_->ending.store(true);
  shared_->changed.notify_all();
}

bool DetachedWorker::post(Job job) {
  const std::lock_guard lock(shared_->mutex);
  if (shared_->jobs.size() >= shared_->most_jobs) return false;
  shared_->jobs.push_back(std::move(job));
  shared_->changed.notify_all();
  return true;
}

bool DetachedWorker::wait(std::chrono::milliseconds timeout) {
  std::unique_lock lock(shared_->mutex);
  return shared_->changed.wait_for(lock, timeout,
                                   [this] { return shared_->jobs.empty() && !shared_->busy; });
}

}  // namespace lenticule::player
