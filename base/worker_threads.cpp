// SPDX-License-Identifier: Apache-2.0
#include "base/worker_threads.h"

#include <algorithm>
#include <system_error>
#include <utility>

namespace lenticule {

WorkerThreads::WorkerThreads(int threads) {
  constexpr int kMostThreads = 64;
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  const int wanted = std::clamp(threads == 0 ? cores : threads, 1, kMostThreads);
  try {
    for (int worker = 1; worker < wanted; ++worker)
      threads_.emplace_back([this, worker](const std::stop_token& stop) { serve(worker, stop); });
  } catch (const std::system_error&) {  // the limit of threads: the jobs only take longer
  }
}

void WorkerThreads::run(int jobs, const std::function<void(int, int)>& work) {
  std::unique_lock lock(mutex_);
  work_ = &work;
  jobs_ = jobs;
  next_ = 0;
  started_.notify_all();
  take_jobs(0, lock);
  ended_.wait(lock, [this] { return running_ == 0; });
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void WorkerThreads::serve(int worker, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (started_.wait(lock, stop, [this] { return next_ < jobs_; })) {
    take_jobs(worker, lock);
    if (running_ == 0) ended_.notify_one();
  }
}

void WorkerThreads::take_jobs(int worker, std::unique_lock<std::mutex>& lock) {
  while (next_ < jobs_) {
    const int job = next_++;
    ++running_;
    lock.unlock();
    std::exception_ptr failure;
    try {
      (*work_)(job, worker);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    --running_;
    if (!failure) continue;
    failure_ = failure;
    next_ = jobs_;  // the remaining results would not be used
  }
}

}  // namespace lenticule
