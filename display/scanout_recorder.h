// SPDX-License-Identifier: Apache-2.0
// Proof of what was on the glass: recorders are given the scan-out memory itself, not what somebody
// meant to show.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "base/retried_writes.h"
#include "frames/frame.h"

namespace lenticule::display {

/// Scan-out memory lent for the length of a call.
struct ScanoutView {
  const uint32_t* pixels = nullptr;  ///< XRGB8888
  size_t stride = 0;                 ///< words from row to row
  frames::FrameGeometry geometry;

  [[nodiscard]] const uint32_t* row(int j) const {
    return pixels + static_cast<size_t>(j) * stride;
  }
};

struct ShownFrame {
  uint64_t sequence = 0;  ///< vblank since which it is on the glass
  uint64_t id = 0;
  /// Frames shown since the last record() that came too fast to be recorded.
  uint64_t skipped_before = 0;
};

/// One thread at a time, apart from the counts.
class ScanoutRecorder {
 public:
  ScanoutRecorder() = default;
  virtual ~ScanoutRecorder() = default;
  ScanoutRecorder(const ScanoutRecorder&) = delete;
  ScanoutRecorder& operator=(const ScanoutRecorder&) = delete;
  /// Never fails here: what the disk does not take is tried again for a while, then counted as
  /// lost, and recording goes on once there is room.
  virtual void record(const ShownFrame& shown, const ScanoutView& scanout) noexcept = 0;
  /// Completes the recording, whose whole part stays. Throws Error(Failed) if any of it did not
  /// reach the disk. Without it, an unfinished file is removed.
  virtual void finish() = 0;

  /// Any thread: frames that were on the glass and came too fast to be recorded.
  [[nodiscard]] uint64_t skipped() const noexcept {
    return skipped_.load(std::memory_order_relaxed);
  }
  void count_skipped() noexcept { skipped_.fetch_add(1, std::memory_order_relaxed); }
  /// Any thread: frames that the disk did not take.
  [[nodiscard]] uint64_t lost() const noexcept { return lost_.load(std::memory_order_relaxed); }
  /// Any thread: how the writes go.
  [[nodiscard]] RetriedWrites& writes() noexcept { return writes_; }

 protected:
  void count_lost(uint64_t frames) noexcept { lost_.fetch_add(frames, std::memory_order_relaxed); }

 private:
  std::atomic<uint64_t> skipped_{0};
  std::atomic<uint64_t> lost_{0};
  RetriedWrites writes_;
};

/// "checksums:FILE": one line "SEQUENCE ID XXH64" per shown frame, over the RGB bytes.
/// "png:DIR": DIR/00000042.png per shown frame, named by its id.
/// Throws Error(Usage) for other text and Error(Failed) for a place that can never be written: a
/// folder that does not exist, a name that is no regular file's. A full disk may change.
[[nodiscard]] std::shared_ptr<ScanoutRecorder> open_recorder(std::string_view spec);

}  // namespace lenticule::display
