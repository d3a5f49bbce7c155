// SPDX-License-Identifier: Apache-2.0
// When pictures were exposed, and how many were lost, from what the driver writes on each buffer.
#pragma once

#include <cstdint>
#include <optional>

#include "calib/camera.h"

namespace lenticule::calib {

/// What came with a buffer.
struct BufferStamp {
  uint32_t sequence = 0;
  Nanoseconds time{0};
  bool monotonic = false;          ///< it is CLOCK_MONOTONIC
  bool start_of_exposure = false;  ///< otherwise it was taken when the last byte had come
};

/// One thread.
class ExposureClock {
 public:
  /// `frame` is the time between two pictures, 0 if unknown.
  ExposureClock(std::optional<Nanoseconds> exposure, Nanoseconds frame)
      : exposure_(exposure.value_or(frame)), frame_(frame) {}

  /// The middle of the exposure of the middle row. A stamp at the end comes when the whole sensor
  /// has been read, for which a frame is allowed: most sensors read row by row, as fast as they
  /// must. Stamps of another clock, of the future, of ten seconds ago or more, or before the last
  /// one, are replaced with `now`.
  [[nodiscard]] Nanoseconds exposed_at(const BufferStamp& stamp, Nanoseconds now);
  /// Counts on where the camera's 32 bits begin again, and where it starts anew by one.
  [[nodiscard]] uint64_t count(uint32_t sequence);
  /// Whether a stamp had to be replaced so far.
  [[nodiscard]] bool unreliable() const { return unreliable_; }

 private:
  Nanoseconds exposure_;
  Nanoseconds frame_;
  Nanoseconds last_stamp_{0};
  std::optional<uint32_t> last_sequence_;
  uint64_t count_ = 0;
  bool unreliable_ = false;
};

}  // namespace lenticule::calib
