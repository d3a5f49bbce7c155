// SPDX-License-Identifier: Apache-2.0
// ScanoutRecorder records displayed frames by reading the scan-out buffer itself, so that the
// recording cannot differ from the output.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

#include "base/retried_writes.h"
#include "display/scanout_depth.h"
#include "frames/frame.h"

namespace lenticule::display {

/// Scan-out memory, borrowed for the duration of a call.
struct ScanoutView {
  const uint32_t* pixels = nullptr;
  size_t stride = 0;  ///< words from one row to the next
  frames::FrameGeometry geometry;
  ScanoutDepth depth = ScanoutDepth::Bits8;

  [[nodiscard]] const uint32_t* row(int j) const {
    return pixels + static_cast<size_t>(j) * stride;
  }
};

struct ShownFrame {
  uint64_t sequence = 0;  ///< vblank since which the frame is displayed
  uint64_t id = 0;
  /// Frames displayed since the last record() that came too fast to be recorded.
  uint64_t skipped_before = 0;
  std::chrono::nanoseconds time{0};  ///< time of that vblank, by the display's clock
};

/// Thread safety: one thread at a time, except for the counts.
class ScanoutRecorder {
 public:
  ScanoutRecorder() = default;
  virtual ~ScanoutRecorder() = default;
  /// Records a frame. Never fails: writes that the disk refuses are retried for a while and then
  /// counted as lost; recording continues once there is space.
  virtual void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept = 0;
  /// Completes the recording; the part that was written is kept. Throws Error(Failed) if any of the
  /// recording did not reach the disk. If finish() is not called, an unfinished file is removed.
  virtual void finish() = 0;

  /// Returns the number of displayed frames that came too fast to be recorded. Thread safety: any
  /// thread.
  [[nodiscard]] uint64_t skipped() const noexcept {
    return skipped_.load(std::memory_order_relaxed);
  }
  void count_skipped() noexcept { skipped_.fetch_add(1, std::memory_order_relaxed); }
  /// Returns the number of frames that the disk did not take. Thread safety: any thread.
  [[nodiscard]] uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }
  /// Returns the state of the writes. Thread safety: any thread.
  [[nodiscard]] RetriedWrites& writes() noexcept { return writes_; }

 protected:
  void count_lost(uint64_t frames) noexcept { lost_.fetch_add(frames, std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> skipped_{0};
  std::atomic<uint64_t> lost_{0};
  RetriedWrites writes_;
};

/// Opens a recorder.
/// "checksums:FILE": one line "SEQUENCE ID XXH64" per displayed frame, over the RGB bytes.
/// "times:FILE": the same lines with the vblank's time in nanoseconds. Each is written at once, so
/// that a killed player leaves the lines of all frames that it displayed.
/// "png:DIR": DIR/00000042.png per displayed frame, named by its id.
/// Throws Error(Usage) for other text and Error(Failed) for a place that can never be written: a
/// folder that does not exist, or a name that is not a regular file. A full disk is not an error,
/// since space may become free.
[[nodiscard]] std::shared_ptr<ScanoutRecorder> open_recorder(std::string_view spec);

}  // namespace lenticule::display
