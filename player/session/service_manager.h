// SPDX-License-Identifier: Apache-2.0
// ServiceManager talks to systemd: notifications, watchdog, and the fd store that keeps descriptors
// for the next process.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule::player {

/// A descriptor that the previous process stored.
struct StoredDescriptor {
  std::string name;
  UniqueFd fd;
};

/// No function throws if the manager does not respond: a player also plays without one. Thread
/// safety: one thread at a time.
class ServiceManager {
 public:
  /// Finds the manager by the environment ($NOTIFY_SOCKET, $WATCHDOG_USEC).
  ServiceManager();

  /// Returns false if this process is not a service; all functions below then do nothing.
  [[nodiscard]] bool present() const noexcept { return present_; }
  /// Returns the longest time between two pings; none = no watchdog.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const noexcept {
    return watchdog_;
  }

  void status(const std::string& text) const noexcept;
  void ready(const std::string& text) const noexcept;
  void stopping(const std::string& text) const noexcept;
  void ping() const noexcept;

  /// Stores a copy of `fd` until the service is stopped, replacing the one of that name.
  void keep(const std::string& name, int fd) const noexcept;
  void forget(const std::string& name) const noexcept;

 private:
  void notify(const std::string& text) const noexcept;

  bool present_ = false;
  std::optional<std::chrono::microseconds> watchdog_;
};

/// Takes the descriptors that the manager passed to this process. Works once, because it clears
/// them from the environment.
[[nodiscard]] std::vector<StoredDescriptor> take_stored_descriptors();

}  // namespace lenticule::player
