// SPDX-License-Identifier: Apache-2.0
// KmsPlatform provides the system calls that KMS output needs beside libdrm. Tests replace it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "display/display.h"
#include "display/kms/device/graphics_console.h"

namespace lenticule::display {

/// HotplugMonitor reports that graphics cards may have changed. Thread safety: one thread.
class HotplugMonitor {
 public:
  virtual ~HotplugMonitor() = default;
  /// Returns a descriptor that is readable when drain() has an event; -1 if never.
  [[nodiscard]] virtual int fd() const noexcept = 0;
  /// Returns true if there was an event. Reads all pending events, so that a burst counts as one
  /// change.
  [[nodiscard]] virtual bool drain() noexcept = 0;
};

class KmsPlatform {
 public:
  virtual ~KmsPlatform() = default;
  /// Maps memory shared, readable and writable; null with errno set on failure.
  [[nodiscard]] virtual void* map(int fd, uint64_t offset, size_t size) noexcept = 0;
  virtual void unmap(void* memory, size_t size) noexcept = 0;
  /// Returns the total time that the machine was suspended since it was started.
  [[nodiscard]] virtual Nanoseconds time_asleep() const noexcept = 0;
  /// Never null; a monitor that cannot listen reports no events.
  [[nodiscard]] virtual std::unique_ptr<HotplugMonitor> watch_hotplug() = 0;
  /// Returns the first 64 KiB of a file of sysfs or debugfs; none if it cannot be read. Thread
  /// safety: any thread.
  [[nodiscard]] virtual std::optional<std::string> read_kernel_file(const std::string& path) = 0;
  /// Never null.
  [[nodiscard]] virtual std::shared_ptr<TerminalCalls> terminal() = 0;
};

[[nodiscard]] std::shared_ptr<KmsPlatform> make_linux_platform();

/// Monitors udev events of the subsystem "drm" (hotplug.cpp).
[[nodiscard]] std::unique_ptr<HotplugMonitor> make_udev_monitor();

}  // namespace lenticule::display
