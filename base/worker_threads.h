// SPDX-License-Identifier: Apache-2.0
// Threads that wait for jobs, so that short jobs need not start threads.
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

namespace lenticule {

/// WorkerThreads distributes the jobs of each run over its threads.
///
/// Thread safety: one caller at a time.
class WorkerThreads {
 public:
  /// Starts the threads; 0 means one thread per core. Keeps those that the system allows.
  explicit WorkerThreads(int threads);

  /// Returns the number of threads including the caller's, at least 1.
  [[nodiscard]] int count() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls work(job, worker) once for every job of 0..jobs-1; `worker` is 0..count()-1, and no two
  /// calls with the same worker run at once. The calling thread works too. Returns when all calls
  /// are done; rethrows the first exception of a call. Does not allocate.
  void run(int jobs, const std::function<void(int job, int worker)>& work);

 private:
  void serve(int worker, const std::stop_token& stop);
  void take_jobs(int worker, std::unique_lock<std::mutex>& lock);

  std::mutex mutex_;
  std::condition_variable_any started_;
  std::condition_variable ended_;
  const std::function<void(int, int)>* work_ = nullptr;
  int jobs_ = 0;
  int next_ = 0;
  int running_ = 0;
  std::exception_ptr failure_;
  std::vector<std::jthread> threads_;  // last member: the threads use everything above
};

}  // namespace lenticule
