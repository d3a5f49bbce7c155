// SPDX-License-Identifier: Apache-2.0
// A running capture: buffers that the driver fills and we read, mapped into memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "calib/camera.h"
#include "calib/cameras/exposure_clock.h"
#include "calib/cameras/v4l2_device.h"

namespace lenticule::calib {

struct CapturedBuffer {
  uint32_t index = 0;
  bool damaged = false;  ///< the driver says so, or it holds more than it has room for
  std::span<const uint8_t> bytes;
  BufferStamp stamp;
};

/// Buffers are reserved, mapped and queued while it lives; the destructor stops the stream, unmaps
/// and gives them back, in this order: whoever opens the camera next would get EBUSY otherwise.
/// One thread; the device must outlive it.
class CaptureStream {
 public:
  /// Throws Error(Device) naming `path`: in use, no memory, fewer than two buffers.
  CaptureStream(V4l2Device& device, V4l2System& system, const std::string& path);
  /// Throws Error(Device).
  void start(V4l2System& system, const std::string& path);

  /// The oldest filled buffer, waiting until `deadline` on the device's clock. Ready: to be given
  /// back after reading. Corrupt: the driver lost a picture, nothing to give back. Gone: failure()
  /// says why, and it will be Gone always.
  [[nodiscard]] GrabStatus take(CapturedBuffer& out, Nanoseconds deadline);
  /// To the driver, to be filled again. False: gone.
  [[nodiscard]] bool give_back(uint32_t index);
  [[nodiscard]] const std::string& failure() const { return failure_; }

 private:
  /// Gives all buffers back to the driver.
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
  /// Stops the stream.
  struct Running {
    explicit Running(V4l2Device& owner) : device(owner) {}
    Running(const Running&) = delete;
    ~Running();
    V4l2Device& device;
  };

  [[nodiscard]] int map_buffer(uint32_t index);
  [[nodiscard]] int queue(uint32_t index);
  enum class Step { Taken, Nothing, Lost, Gone };
  [[nodiscard]] Step look(CapturedBuffer& out, Nanoseconds left);
  [[nodiscard]] Step nothing_dequeued(int error, bool broken);
  Step gone(int error);

  V4l2Device& device_;
  // Destroyed from the last to the first.
  Reservation reservation_;
  std::vector<Mapping> buffers_;
  std::unique_ptr<Running> running_;
  std::string failure_;
  int losses_in_a_row_ = 0;
};

}  // namespace lenticule::calib
