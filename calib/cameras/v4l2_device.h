// SPDX-License-Identifier: Apache-2.0
// V4l2Device and V4l2System wrap the system calls for cameras: nodes, ioctls, memory, waiting and
// time. Tests replace them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "calib/camera.h"

namespace lenticule::calib {

/// V4l2Device is an open video node; the destructor closes it. Only poll() waits for the camera.
///
/// Thread safety: one thread.
class V4l2Device {
 public:
  virtual ~V4l2Device() = default;

  /// Does one ioctl. Returns 0 or the errno (EINTR included: see v4l2_call).
  [[nodiscard]] virtual int control(unsigned long request, void* argument) noexcept = 0;
  /// Waits for a picture, at most `timeout`. Returns the events of poll(2), 0 when there are none
  /// or a signal arrived, -errno on failure.
  [[nodiscard]] virtual int poll(Nanoseconds timeout) noexcept = 0;
  /// Maps shared, readable memory; returns null on failure.
  [[nodiscard]] virtual void* map(size_t size, uint32_t offset) noexcept = 0;
  virtual void unmap(void* memory, size_t size) noexcept = 0;
  /// Returns the time of CLOCK_MONOTONIC, the clock of the camera's own timestamps.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
};

/// V4l2Node is a video node with its stable name under /dev/v4l, which is empty if there is none.
struct V4l2Node {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/usb-Maker_Camera_1234-video-index0"
};

struct OpenedDevice {
  std::unique_ptr<V4l2Device> device;  ///< null if the node could not be opened
  int error = 0;                       ///< errno of the failure
};

class V4l2System {
 public:
  virtual ~V4l2System() = default;
  /// Returns all video nodes, ordered by number. Opens none of them.
  [[nodiscard]] virtual std::vector<V4l2Node> nodes() = 0;
  /// Opens a node. Never waits for the device.
  [[nodiscard]] virtual OpenedDevice open(const std::string& path) = 0;
  /// Returns the programs that have the node open, as far as this user can see them: "guvcview
  /// (4711)". Empty if none.
  [[nodiscard]] virtual std::string holders(const std::string& path) = 0;
  /// Returns the group whose members may use the node: "video". Empty if unknown.
  [[nodiscard]] virtual std::string group(const std::string& path) = 0;
};

/// Returns the kernel's system, shared by all callers.
///
/// Thread safety: any thread.
[[nodiscard]] V4l2System& linux_v4l2();

/// Does an ioctl and repeats it when a signal interrupts it, a limited number of times. Returns 0
/// or errno.
[[nodiscard]] int v4l2_call(V4l2Device& device, unsigned long request, void* argument) noexcept;

// Translates failed camera calls to messages with a remedy.

/// Returns the system's text for an errno in lower case, as in a sentence: "no such device".
///
/// Thread safety: any thread.
[[nodiscard]] std::string error_text(int error);

/// Returns an Error(Device) for `path` that could not be opened, or refused `doing` during setup
/// ("set the format"). Names the programs that have the camera open, and the missing group.
[[nodiscard]] Error camera_failure(V4l2System& system, const std::string& path,
                                   const std::string& doing, int error);

}  // namespace lenticule::calib
