// SPDX-License-Identifier: Apache-2.0
// RecordingThread passes displayed buffers to a recorder on its own thread, so that the presenter
// never waits for a disk.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "display/scanout_recorder.h"
#include "display/virtual/virtual_buffer.h"

namespace lenticule::display {

class RecordingThread {
 public:
  /// Holds at most `capacity` buffers at a time, waiting or being recorded.
  RecordingThread(std::shared_ptr<ScanoutRecorder> recorder, size_t capacity);
  /// Records the waiting buffers, then ends the thread.
  ~RecordingThread();
  RecordingThread(const RecordingThread&) = delete;
  RecordingThread& operator=(const RecordingThread&) = delete;

  /// Queues a buffer and returns at once. The buffer stays in use until it is recorded. Thread
  /// safety: the presenter thread.
  void offer(ShownFrame shown, VirtualBuffer* buffer) noexcept;

 private:
  struct Job {
    ShownFrame shown;
    VirtualBuffer* buffer = nullptr;
  };

  void run() noexcept;

  std::shared_ptr<ScanoutRecorder> recorder_;
  uint64_t skipped_ = 0;  ///< frames skipped since the last queued one; presenter thread only

  std::mutex mutex_;  ///< guards all members below, for a few instructions at a time
  std::condition_variable changed_;
  std::vector<Job> jobs_;  ///< ring buffer of `capacity` jobs
  size_t first_ = 0;
  size_t count_ = 0;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace lenticule::display
