// SPDX-License-Identifier: Apache-2.0
// CaptureStream is a running capture: buffers that the driver fills, mapped into memory and read by
// the program.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

// ExposureClock computes the exposure times of pictures and the number of lost pictures from the
// stamps of the driver's buffers.

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

struct CapturedBuffer {
  uint32_t index = 0;
  bool damaged = false;  ///< the driver reports damage, or a length beyond the buffer
  std::span<const uint8_t> bytes;
  BufferStamp stamp;
};

/// CaptureStream reserves, maps and queues buffers. Its destructor stops the stream, unmaps and
/// frees the buffers, in this order: otherwise the next program that opens the camera would get
/// EBUSY.
///
/// Thread safety: one thread.
///
/// Lifetime: the device must outlive the stream.
class CaptureStream {
 public:
  /// Throws Error(Device) that names `path`: in use, no memory, fewer than two buffers.
  CaptureStream(V4l2Device& device, V4l2System& system, const std::string& path);
  /// Starts the stream. Throws Error(Device).
  void start(V4l2System& system, const std::string& path);

  /// Waits until `deadline` on the device's clock for the oldest filled buffer. Ready: the caller
  /// must give the buffer back after reading. Corrupt: the driver lost a picture, and there is no
  /// buffer to give back. Gone: failure() has the cause, and all later calls return Gone too.
  [[nodiscard]] GrabStatus acquire(CapturedBuffer& out, Nanoseconds deadline);
  /// Returns a buffer to the driver, to be filled again. Returns false if the camera is gone.
  [[nodiscard]] bool give_back(uint32_t index);
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  /// Reservation frees all buffers at the driver in its destructor.
  struct Reservation {
    explicit Reservation(V4l2Device& owner) : device(owner) {}
    Reservation(const Reservation&) = delete;
    ~Reservation();
    V4l2Device& device;
  };
  struct Unmap {
    V4l2Device* device;
    size_t size;
    void operator()(void* memory) const noexcept { device->unmap(memory, size); }
  };
  using Mapping = std::unique_ptr<void, Unmap>;
  /// Running stops the stream in its destructor.
  struct Running {
    explicit Running(V4l2Device& owner) : device(owner) {}
    Running(const Running&) = delete;
    ~Running();
    V4l2Device& device;
  };

  [[nodiscard]] int map_buffer(uint32_t index);
  [[nodiscard]] int queue(uint32_t index);
  enum class Step { Taken, Nothing, Lost, Gone };
  [[nodiscard]] Step dequeue(CapturedBuffer& out, Nanoseconds left);
  [[nodiscard]] Step nothing_dequeued(int error, bool broken);
  Step gone(int error);

  V4l2Device& device_;
  // Members are destroyed from the last to the first.
  Reservation reservation_;
  std::vector<Mapping> buffers_;
  std::unique_ptr<Running> running_;
  std::string failure_;
  int losses_in_a_row_ = 0;
};

}  // namespace lenticule::calib
