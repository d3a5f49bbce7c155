// SPDX-License-Identifier: Apache-2.0
// What cameras need from the system: nodes, calls, memory, waiting and the time. Tests put their
// own in its place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "calib/camera.h"

namespace lenticule::calib {

/// An open video node; the destructor closes it. One thread. No call waits for the camera except
/// poll().
class V4l2Device {
 public:
  virtual ~V4l2Device() = default;

  /// One ioctl. 0, or the errno that it left (EINTR included: see v4l2_call).
  [[nodiscard]] virtual int control(unsigned long request, void* argument) noexcept = 0;
  /// Waits for a picture, at most `timeout`. The events of poll(2), 0 when there are none or when a
  /// signal came, -errno when it failed.
  [[nodiscard]] virtual int poll(Nanoseconds timeout) noexcept = 0;
  /// Shared and readable; null if it fails.
  [[nodiscard]] virtual void* map(size_t size, uint32_t offset) noexcept = 0;
  virtual void unmap(void* memory, size_t size) noexcept = 0;
  /// CLOCK_MONOTONIC, the clock of the camera's own timestamps.
  [[nodiscard]] virtual Nanoseconds now() const noexcept = 0;
};

/// A video node, and the name under /dev/v4l that stays its own, empty if it has none.
struct V4l2Node {
  std::string path;         ///< "/dev/video0"
  std::string stable_path;  ///< "/dev/v4l/by-id/usb-Maker_Camera_1234-video-index0"
};

struct OpenedDevice {
  std::unique_ptr<V4l2Device> device;  ///< null if it could not be opened
  int error = 0;                       ///< errno then
};

class V4l2System {
 public:
  virtual ~V4l2System() = default;
  /// All video nodes, ordered by number. Opens nothing.
  [[nodiscard]] virtual std::vector<V4l2Node> nodes() = 0;
  /// Never waits for the device.
  [[nodiscard]] virtual OpenedDevice open(const std::string& path) = 0;
  /// Programs that have it open, as far as this user may know: "guvcview (4711)". Empty if none.
  [[nodiscard]] virtual std::string holders(const std::string& path) = 0;
  /// The group whose members may use it: "video". Empty if unknown.
  [[nodiscard]] virtual std::string group(const std::string& path) = 0;
};

/// The kernel's own. Shared by all callers, safe from any thread.
[[nodiscard]] V4l2System& linux_v4l2();

/// A call that is made again when a signal interrupts it, though not for ever. 0 or errno.
[[nodiscard]] int v4l2_call(V4l2Device& device, unsigned long request, void* argument) noexcept;

}  // namespace lenticule::calib
