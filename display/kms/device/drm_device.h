// SPDX-License-Identifier: Apache-2.0
// DrmNode names a graphics card; DrmDevice is a card that is open for modesetting.
#pragma once

#include <drm_fourcc.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/unique_fd.h"
#include "display/kms/device/platform.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

struct DrmNode {
  std::string path;  ///< "/dev/dri/card1"
  std::string bus;   ///< "pci 0000:00:02.0", "usb", "platform", ...
};

/// Returns the primary nodes of all cards, with or without outputs. Opens none of them.
[[nodiscard]] std::vector<DrmNode> find_drm_nodes();

/// Returns true if both paths name the same device; by-path links are resolved.
[[nodiscard]] bool same_device(const std::string& a, const std::string& b);

struct DrmCaps {
  bool dumb_buffers = false;
  bool prefer_shadow = false;
  bool monotonic_timestamps = false;
  bool crtc_in_event = false;
  bool atomic = false;  ///< the client capabilities were granted

  [[nodiscard]] bool sufficient() const {
    return dumb_buffers && monotonic_timestamps && crtc_in_event && atomic;
  }
};

/// An open card with the client capabilities set. Movable. Thread safety: one thread.
class DrmDevice {
 public:
  /// Opens a card. Throws Error(Device) if it cannot be opened or has no outputs. If the card has
  /// no DRM master, this process becomes master.
  static DrmDevice open(std::shared_ptr<Session> session, const DrmNode& node);
  /// Takes over a descriptor that another process left open. Throws Error(Device) unless it is a
  /// card with outputs.
  static DrmDevice adopt(std::shared_ptr<Session> session, UniqueFd fd, std::string path);
  DrmDevice(DrmDevice&& other) noexcept = default;
  ~DrmDevice() {
    if (fd_) session_->close_device(fd_.get());
  }

  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& driver() const { return driver_; }
  [[nodiscard]] const DrmCaps& caps() const { return caps_; }
  [[nodiscard]] Session& session() const { return *session_; }

 private:
  DrmDevice(std::shared_ptr<Session> session, UniqueFd fd, std::string path);

  std::shared_ptr<Session> session_;
  UniqueFd fd_;
  std::string path_;
  std::string driver_;
  DrmCaps caps_;
};

/// Returns the kernel's code of the format that frames of this depth are scanned out in.
[[nodiscard]] constexpr uint32_t drm_format(ScanoutDepth depth) {
  return depth == ScanoutDepth::Bits10 ? DRM_FORMAT_XRGB2101010 : DRM_FORMAT_XRGB8888;
}

}  // namespace lenticule::display
