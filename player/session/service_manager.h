// SPDX-License-Identifier: Apache-2.0
// systemd as a service sees it: what we tell it, its watchdog, and the descriptors that it keeps
// for whoever comes after us.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "base/unique_fd.h"

namespace lenticule::player {

/// What our predecessor asked to be kept.
struct KeptDescriptor {
  std::string name;
  UniqueFd fd;
};

/// Nothing here throws for what the manager does or does not: a player plays on without one. One
/// thread at a time.
class ServiceManager {
 public:
  /// Whoever the environment names ($NOTIFY_SOCKET, $WATCHDOG_USEC).
  ServiceManager();

  /// False when this is no service; then everything below does nothing.
  [[nodiscard]] bool present() const noexcept { return present_; }
  /// Pings must come more often than that; none = nobody watches.
  [[nodiscard]] std::optional<std::chrono::microseconds> watchdog() const noexcept {
    return watchdog_;
  }

  void status(const std::string& text) const noexcept;
  void ready(const std::string& text) const noexcept;
  void stopping(const std::string& text) const noexcept;
  void ping() const noexcept;

  /// Keeps a copy of `fd` until the service is stopped for good, in place of what had that name.
  void keep(const std::string& name, int fd) const noexcept;
  void forget(const std::string& name) const noexcept;

 private:
  void tell(const std::string& text) const noexcept;

  bool present_ = false;
  std::optional<std::chrono::microseconds> watchdog_;
};

/// Those handed to this process, and only once: the environment says nothing about them afterwards.
[[nodiscard]] std::vector<KeptDescriptor> take_kept_descriptors();

}  // namespace lenticule::player
