// SPDX-License-Identifier: Apache-2.0
// ExposureClock computes the exposure times of pictures and the number of lost pictures from the
// stamps of the driver's buffers.
#pragma once

#include <cstdint>
#include <optional>

#include "calib/camera.h"

namespace lenticule::calib {

/// BufferStamp is the driver's stamp of a buffer.
struct BufferStamp {
  uint32_t sequence = 0;
  Nanoseconds time{0};
  bool monotonic = false;          ///< the time is CLOCK_MONOTONIC
  bool start_of_exposure = false;  ///< otherwise the stamp was taken when the last byte arrived
};

/// ExposureClock tracks one stream.
///
/// Thread safety: one thread.
class ExposureClock {
 public:
  /// Takes the exposure time, if known, and the time between two pictures, 0 if unknown.
  ExposureClock(std::optional<Nanoseconds> exposure, Nanoseconds frame)
      : exposure_(exposure.value_or(frame)), frame_(frame) {}

  /// Returns the time of the middle of the middle row's exposure. A stamp at the end is taken when
  /// the whole sensor has been read, for which one frame is assumed: most sensors read row by row
  /// during the whole frame. Stamps of another clock, in the future, ten or more seconds old, or
  /// before the previous stamp are replaced with `now`.
  [[nodiscard]] Nanoseconds exposed_at(const BufferStamp& stamp, Nanoseconds now);
  /// Returns a 64-bit count, which continues where the camera's 32 bits wrap, and adds one where
  /// the camera restarts its count.
  [[nodiscard]] uint64_t count(uint32_t sequence);
  /// Returns true if any stamp so far had to be replaced.
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
