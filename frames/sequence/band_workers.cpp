// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/band_workers.h"

#include <algorithm>
#include <utility>

namespace lenticule::frames {
namespace {

constexpr int kMaxWorkers = 64;

int workers_of(int threads) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(threads == 0 ? cores : threads, 1, kMaxWorkers);
}

}  // namespace

BandWorkers::BandWorkers(int threads) : count_(workers_of(threads)) {
  for (int worker = 1; worker < count_; ++worker)
    threads_.emplace_back([this, worker] { serve(worker); });
}

BandWorkers::~BandWorkers() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  started_.notify_all();
}

void BandWorkers::run(int bands, const std::function<void(int, int)>& job) {
  std::unique_lock lock(mutex_);
  job_ = &job;
  bands_ = bands;
  next_ = 0;
  started_.notify_all();
  work(0, lock);
  ended_.wait(lock, [this] { return running_ == 0; });
  job_ = nullptr;
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void BandWorkers::serve(int worker) {
  std::unique_lock lock(mutex_);
  while (true) {
    started_.wait(lock, [this] { return stopping_ || next_ < bands_; });
    if (stopping_) return;
    work(worker, lock);
    if (running_ == 0) ended_.notify_one();
  }
}

void BandWorkers::work(int worker, std::unique_lock<std::mutex>& lock) {
  while (next_ < bands_) {
    const int band = next_++;
    ++running_;
    lock.unlock();
    std::exception_ptr failure;
    try {
      (*job_)(band, worker);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    --running_;
    if (!failure) continue;
    failure_ = failure;
    next_ = bands_;  // the remaining results would not be used
  }
}

}  // namespace lenticule::frames
