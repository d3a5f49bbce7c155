// SPDX-License-Identifier: Apache-2.0
// What KMS output needs from the system apart from libdrm. Tests put their own in its place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "display/display.h"
#include "display/kms/device/graphics_console.h"

namespace lenticule::display {

/// Says that something about graphics cards may have changed. One thread.
class HotplugMonitor {
 public:
  virtual ~HotplugMonitor() = default;
  /// Readable when drain() has something to say; -1 if it never will.
  [[nodiscard]] virtual int fd() const noexcept = 0;
  /// True if there was news. Reads all of it, so that a storm is one change.
  [[nodiscard]] virtual bool drain() noexcept = 0;
};

class KmsPlatform {
 public:
  virtual ~KmsPlatform() = default;
  /// Shared, readable and writable; null with errno set if it fails.
  [[nodiscard]] virtual void* map(int fd, uint64_t offset, size_t size) noexcept = 0;
  virtual void unmap(void* memory, size_t size) noexcept = 0;
  /// How long the machine was suspended since it was started.
  [[nodiscard]] virtual Nanoseconds time_asleep() const noexcept = 0;
  /// Never null; a monitor that cannot listen stays silent.
  [[nodiscard]] virtual std::unique_ptr<HotplugMonitor> watch_hotplug() = 0;
  /// The text of a file of sysfs or debugfs, its first 64 KiB; none if it cannot be read. Any
  /// thread.
  [[nodiscard]] virtual std::optional<std::string> read_kernel_file(const std::string& path) = 0;
  /// Never null.
  [[nodiscard]] virtual std::shared_ptr<TerminalCalls> terminal() = 0;
};

[[nodiscard]] std::shared_ptr<KmsPlatform> make_linux_platform();

/// udev's news about the subsystem "drm" (hotplug.cpp).
[[nodiscard]] std::unique_ptr<HotplugMonitor> make_udev_monitor();

}  // namespace lenticule::display
