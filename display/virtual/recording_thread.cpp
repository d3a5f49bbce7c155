// SPDX-License-Identifier: Apache-2.0
#include "display/virtual/recording_thread.h"

#include <utility>

namespace lenticule::display {

RecordingThread::RecordingThread(std::shared_ptr<ScanoutRecorder> recorder, size_t capacity)
    : recorder_(std::move(recorder)), jobs_(capacity), thread_([this] { run(); }) {}

RecordingThread::~RecordingThread() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void RecordingThread::offer(ShownFrame shown, VirtualBuffer* buffer) noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (count_ == jobs_.size()) {
      ++skipped_;
      recorder_->count_skipped();
      return;
    }
    shown.skipped_before = std::exchange(skipped_, 0);
    buffer->begin_recording();
    jobs_[(first_ + count_) % jobs_.size()] = {shown, buffer};
    ++count_;
  }
  changed_.notify_one();
}

void RecordingThread::run() noexcept {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return count_ > 0 || ending_; });
    if (count_ == 0) return;
    const Job job = jobs_[first_];
    lock.unlock();
    recorder_->record(job.shown, job.buffer->view());
    job.buffer->end_recording();
    lock.lock();
    // The job is counted until it is done, so that jobs_.size() bounds the buffers taken from the
    // display.
    first_ = (first_ + 1) % jobs_.size();
    --count_;
  }
}

}  // namespace lenticule::display
