// SPDX-License-Identifier: Apache-2.0
// BandWorkers is a small thread pool that distributes the bands of one frame.
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace lenticule::frames {

class BandWorkers {
 public:
  /// Starts the threads; 0 means one thread per core.
  explicit BandWorkers(int threads);
  ~BandWorkers();
  BandWorkers(const BandWorkers&) = delete;
  BandWorkers& operator=(const BandWorkers&) = delete;

  [[nodiscard]] int count() const { return count_; }

  /// Calls job(band, worker) once for every band of 0..bands-1; `worker` is 0..count()-1, and no
  /// two calls with the same worker run at once. The calling thread works too. Returns when all
  /// calls are done; rethrows the first exception of a job.
  void run(int bands, const std::function<void(int band, int worker)>& job);

 private:
  void serve(int worker);
  void work(int worker, std::unique_lock<std::mutex>& lock);

  int count_;
  std::mutex mutex_;
  std::condition_variable started_;
  std::condition_variable ended_;
  const std::function<void(int, int)>* job_ = nullptr;
  int bands_ = 0;
  int next_ = 0;
  int running_ = 0;
  bool stopping_ = false;
  std::exception_ptr failure_;
  std::vector<std::jthread> threads_;  // last member: the threads use everything above
};

}  // namespace lenticule::frames
