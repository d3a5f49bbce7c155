// SPDX-License-Identifier: Apache-2.0
// Hands shown buffers to a recorder on a thread of its own, so that the presenter never waits for a
// disk.
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
  /// Takes at most `capacity` buffers at a time: waiting, or in the recorder's hands.
  RecordingThread(std::shared_ptr<ScanoutRecorder> recorder, size_t capacity);
  /// Records what is waiting, then ends the thread.
  ~RecordingThread();
  RecordingThread(const RecordingThread&) = delete;
  RecordingThread& operator=(const RecordingThread&) = delete;

  /// Presenter thread; returns at once. The buffer stays taken until it is recorded.
  void offer(ShownFrame shown, VirtualBuffer* buffer) noexcept;

 private:
  struct Job {
    ShownFrame shown;
    VirtualBuffer* buffer = nullptr;
  };

  void run() noexcept;

  std::shared_ptr<ScanoutRecorder> recorder_;
  uint64_t skipped_ = 0;  ///< since the last that was taken; presenter thread only

  std::mutex mutex_;  ///< guards everything below it, for a few instructions at a time
  std::condition_variable changed_;
  std::vector<Job> jobs_;  ///< a ring of `capacity`
  size_t first_ = 0;
  size_t count_ = 0;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace lenticule::display
