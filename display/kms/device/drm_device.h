// SPDX-License-Identifier: Apache-2.0
// DrmNode names a graphics card; DrmDevice is a card that is open for modesetting.
#pragma once

#include <drm_fourcc.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/unique_fd.h"
#include "display/kms/device/drm_properties.h"
#include "display/kms/device/platform.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

struct DrmNode {
  std::string path;  ///< "/dev/dri/card1"
  std::string bus;   ///< "pci 0000:00:02.0", "usb", "platform", ...
};

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

inline constexpr int kMaxDevices = 64;
/// DRM_CLIENT_CAP_PLANE_COLOR_PIPELINE of Linux 6.19; older kernels and headers lack it.
inline constexpr uint64_t kPlaneColorPipeline = 7;

inline std::string bus_of(const drmDevice& device) {
  switch (device.bustype) {
    case DRM_BUS_PCI:
      return fmt::format("pci {:04x}:{:02x}:{:02x}.{:x}", device.businfo.pci->domain,
                         device.businfo.pci->bus, device.businfo.pci->dev,
                         device.businfo.pci->func);
    case DRM_BUS_USB:
      return "usb";
    case DRM_BUS_PLATFORM:
      return "platform";
    default:
      return "other";
  }
}

inline uint64_t capability(int fd, uint64_t which) {
  uint64_t value = 0;
  return drmGetCap(fd, which, &value) == 0 ? value : 0;
}

inline DrmCaps read_caps(int fd) {
  const bool planes = drmSetClientCap(fd, DRM_CLIENT_CAP_UNIVERSAL_PLANES, 1) == 0;
  const bool atomic = drmSetClientCap(fd, DRM_CLIENT_CAP_ATOMIC, 1) == 0;
  // Without it the kernel hides, and keeps in effect, a colour pipeline that another program chose.
  (void)drmSetClientCap(fd, kPlaneColorPipeline, 1);
  return {.dumb_buffers = capability(fd, DRM_CAP_DUMB_BUFFER) == 1,
          .prefer_shadow = capability(fd, DRM_CAP_DUMB_PREFER_SHADOW) == 1,
          .monotonic_timestamps = capability(fd, DRM_CAP_TIMESTAMP_MONOTONIC) == 1,
          .crtc_in_event = capability(fd, DRM_CAP_CRTC_IN_VBLANK_EVENT) == 1,
          .atomic = planes && atomic};
}

inline std::string driver_of(int fd) {
  const DrmVersion version(drmGetVersion(fd));
  if (!version || version->name == nullptr) return "unknown";
  return {version->name, static_cast<size_t>(std::max(version->name_len, 0))};
}

/// Returns the primary nodes of all cards, with or without outputs. Opens none of them.
[[nodiscard]] inline std::vector<DrmNode> find_drm_nodes() {
  std::array<drmDevicePtr, kMaxDevices> devices{};
  const int count = drmGetDevices2(0, devices.data(), kMaxDevices);
  std::vector<DrmNode> nodes;
  for (int i = 0; i < count; ++i)
    if ((devices[static_cast<size_t>(i)]->available_nodes & 1 << DRM_NODE_PRIMARY) != 0)
      nodes.push_back({.path = devices[static_cast<size_t>(i)]->nodes[DRM_NODE_PRIMARY],
                       .bus = bus_of(*devices[static_cast<size_t>(i)])});
  if (count > 0) drmFreeDevices(devices.data(), count);
  std::ranges::sort(nodes, [](const DrmNode& a, const DrmNode& b) { return a.path < b.path; });
  return nodes;
}

/// Returns true if both paths name the same device; by-path links are resolved.
[[nodiscard]] inline bool same_device(const std::string& a, const std::string& b) {
  struct stat first {};
  struct stat second {};
  if (stat(a.c_str(), &first) == 0 && stat(b.c_str(), &second) == 0 && S_ISCHR(first.st_mode) &&
      S_ISCHR(second.st_mode))
    return first.st_rdev == second.st_rdev;
  std::error_code error;
  return std::filesystem::weakly_canonical(a, error) == std::filesystem::weakly_canonical(b, error);
}

/// An open card with the client capabilities set. Movable. Thread safety: one thread.
class DrmDevice {
 public:
  /// Opens a card. Throws Error(Device) if it cannot be opened or has no outputs. If the card has
  /// no DRM master, this process becomes master.
  static DrmDevice open(std::shared_ptr<Session> session, const DrmNode& node) {
    UniqueFd fd = session->open_device(node.path);
    return {std::move(session), std::move(fd), node.path};
  }
  /// Takes over a descriptor that another process left open. Throws Error(Device) unless it is a
  /// card with outputs.
  static DrmDevice adopt(std::shared_ptr<Session> session, UniqueFd fd, std::string path) {
    return {std::move(session), std::move(fd), std::move(path)};
  }
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
  DrmDevice(std::shared_ptr<Session> session, UniqueFd fd, std::string path)
      : session_(std::move(session)), fd_(std::move(fd)), path_(std::move(path)) {
    if (drmIsKMS(fd_.get()) == 0) throw device_error("{}: the card has no outputs", path_);
    driver_ = driver_of(fd_.get());
    caps_ = read_caps(fd_.get());
  }

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
