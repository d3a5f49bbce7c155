// SPDX-License-Identifier: Apache-2.0
// A few threads that share out the bands of one frame.
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
  /// 0 means all cores.
  explicit BandWorkers(int threads);
  ~BandWorkers();
  BandWorkers(const BandWorkers&) = delete;
  BandWorkers& operator=(const BandWorkers&) = delete;

  [[nodiscard]] int count() const { return count_; }

  /// Calls job(band, worker) once for every band of 0..bands-1; `worker` is 0..count()-1, and no
  /// two calls with the same one run at a time. Returns when all are done; the first exception of a
  /// job is thrown again here. The calling thread works too.
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
  std::vector<std::jthread> threads_;  // last: they use everything above
};

}  // namespace lenticule::frames
