// SPDX-License-Identifier: Apache-2.0
// DetachedWorker runs jobs one after the other on a thread of its own, for calls that may hang: a
// disk, the journal. A hanging job does not prevent the program from ending.
#pragma once

#include <pthread.h>
#include <sched.h>
#include <sys/syscall.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

namespace lenticule::player {

/// Thread safety: one thread. Lifetime: jobs own what they use, because a hanging job outlives the
/// worker.
class DetachedWorker {
 public:
  using Job = std::function<void(const std::atomic<bool>& ending)>;

  /// Keeps at most `most_jobs`. A `background` worker gets only processor time and disk time that
  /// other threads leave.
  explicit DetachedWorker(size_t most_jobs, bool background = false)
      : shared_(std::make_shared<Shared>()) {
    shared_->most_jobs = most_jobs;
    shared_->background = background;
    std::thread([shared = shared_] { shared->work(); }).detach();
  }
  /// Tells the running job to end, and drops jobs that have not begun.
  ~DetachedWorker() {
    const std::lock_guard lock(shared_->mutex);
    shared_->ending.store(true);
    shared_->changed.notify_all();
  }
  DetachedWorker(const DetachedWorker&) = delete;
  DetachedWorker& operator=(const DetachedWorker&) = delete;

  /// Returns at once; false if too many jobs wait. The job must not throw.
  [[nodiscard]] bool post(Job job) {
    const std::lock_guard lock(shared_->mutex);
    if (shared_->jobs.size() >= shared_->most_jobs) return false;
    shared_->jobs.push_back(std::move(job));
    shared_->changed.notify_all();
    return true;
  }
  /// Waits until all jobs are done; returns false if that takes longer than `timeout`.
  [[nodiscard]] bool wait(std::chrono::milliseconds timeout) {
    std::unique_lock lock(shared_->mutex);
    return shared_->changed.wait_for(lock, timeout,
                                     [this] { return shared_->jobs.empty() && !shared_->busy; });
  }

 private:
  /// Gives this thread only the time that others leave. A refusal changes nothing but the speed.
  static void stay_in_background() noexcept {
    constexpr int kThisThread = 1;           // IOPRIO_WHO_PROCESS
    constexpr int kIdleDiskClass = 3 << 13;  // IOPRIO_CLASS_IDLE
    const sched_param parameters{};
    (void)pthread_setschedparam(pthread_self(), SCHED_IDLE, &parameters);
    (void)syscall(SYS_ioprio_set, kThisThread, 0, kIdleDiskClass);
  }

  struct Shared {
    void work() noexcept {
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

    size_t most_jobs = 0;
    bool background = false;
    std::atomic<bool> ending{false};
    std::mutex mutex;  ///< guards the members below
    std::condition_variable changed;
    std::deque<Job> jobs;
    bool busy = false;
  };
  std::shared_ptr<Shared> shared_;
};

}  // namespace lenticule::player
