// SPDX-License-Identifier: Apache-2.0
// Interfaces to what KMS output needs from the system beside libdrm. Tests replace them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/unique_fd.h"
#include "display/display.h"
#include "display/kms/device/graphics_console.h"

namespace lenticule::display {

enum class Mastership {
  Held,    ///< this process may commit
  Denied,  ///< not permitted (EACCES): another session is active, or another process opened the
           ///< card first
  Busy,    ///< another program is DRM master (EBUSY)
};

/// Session opens cards and becomes their master.
/// Thread safety: one thread; open_device() may be called before that thread exists.
class Session {
 public:
  virtual ~Session() = default;
  /// Opens the device at `path`. Throws Error(Device) that names the path.
  [[nodiscard]] virtual UniqueFd open_device(const std::string& path) = 0;
  /// Called before the descriptor is closed.
  virtual void close_device(int fd) noexcept = 0;
  /// Tries to become DRM master and returns the result.
  [[nodiscard]] virtual Mastership ensure_master(int fd) noexcept = 0;
  virtual void drop_master(int fd) noexcept = 0;
};

/// Returns a session that opens nodes directly: the first opener is DRM master. Used by kiosks.
[[nodiscard]] std::shared_ptr<Session> make_direct_session();

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

/// KmsPlatform provides the system calls that KMS output needs beside libdrm. Tests replace it.
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

}  // namespace lenticule::display
