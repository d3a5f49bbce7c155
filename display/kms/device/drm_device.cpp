// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/drm_device.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>

#include "base/error.h"
#include "display/kms/device/drm_properties.h"

namespace lenticule::display {
namespace {

constexpr int kMaxDevices = 64;
/// DRM_CLIENT_CAP_PLANE_COLOR_PIPELINE of Linux 6.19; older kernels and headers lack it.
constexpr uint64_t kPlaneColorPipeline = 7;

std::string bus_of(const drmDevice& device) {
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

uint64_t capability(int fd, uint64_t which) {
  uint64_t value = 0;
  return drmGetCap(fd, which, &value) == 0 ? value : 0;
}

DrmCaps read_caps(int fd) {
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

std::string driver_of(int fd) {
  const DrmVersion version(drmGetVersion(fd));
  if (!version || version->name == nullptr) return "unknown";
  return {version->name, static_cast<size_t>(std::max(version->name_len, 0))};
}

}  // namespace

std::vector<DrmNode> find_drm_nodes() {
  std::array<drmDevicePtr, kMaxDevices> devices{};
  const int count = drmGetDevices2(0, devices.data(), kMaxDevices);
  std::vector<DrmNode> nodes;
  for (int i = 0; i < count; ++i)
    if ((devices[static_cast<size_t>(i)]->available_nodes & 1 << DRM_NODE_PRIMARY) != 0)
      nodes.push_back({.path = devices[static_cast<size_t>(i)]->nodes[DRM_NODE_PRIMARY],
                       .bus = bus_of(*devices[static_cast<size_t>(i)])});
  if (count > 0) drmFreeDevices(devices.data(), count);
  std::sort(nodes.begin(), nodes.end(),
            [](const DrmNode& a, const DrmNode& b) { return a.path < b.path; });
  return nodes;
}

bool same_device(const std::string& a, const std::string& b) {
  struct stat first {};
  struct stat second {};
  if (stat(a.c_str(), &first) == 0 && stat(b.c_str(), &second) == 0 && S_ISCHR(first.st_mode) &&
      S_ISCHR(second.st_mode))
    return first.st_rdev == second.st_rdev;
  std::error_code error;
  return std::filesystem::weakly_canonical(a, error) == std::filesystem::weakly_canonical(b, error);
}

DrmDevice::DrmDevice(std::shared_ptr<Session> session, UniqueFd fd, std::string path)
    : session_(std::move(session)), fd_(std::move(fd)), path_(std::move(path)) {
  if (drmIsKMS(fd_.get()) == 0)
    throw Error(ErrorKind::Device, fmt::format("{}: the card has no outputs", path_));
  driver_ = driver_of(fd_.get());
  caps_ = read_caps(fd_.get());
}

DrmDevice DrmDevice::open(std::shared_ptr<Session> session, const DrmNode& node) {
  UniqueFd fd = session->open_device(node.path);
  return {std::move(session), std::move(fd), node.path};
}

DrmDevice DrmDevice::adopt(std::shared_ptr<Session> session, UniqueFd fd, std::string path) {
  return {std::move(session), std::move(fd), std::move(path)};
}

}  // namespace lenticule::display
