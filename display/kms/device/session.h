// SPDX-License-Identifier: Apache-2.0
// Session opens cards and tracks whether this process may use them at the moment.
#pragma once

#include <memory>
#include <string>

#include "base/unique_fd.h"

namespace lenticule::display {

enum class Mastership {
  Held,    ///< this process may commit
  Denied,  ///< not permitted (EACCES): another session is active, or another process opened the
           ///< card first
  Busy,    ///< another program is DRM master (EBUSY)
};

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
  /// Returns a descriptor that is readable when dispatch() should be called; -1 if never.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }
  /// Handles messages of the seat manager. Returns false while the seat is inactive.
  [[nodiscard]] virtual bool dispatch() noexcept { return true; }
};

/// Returns a session that opens nodes directly: the first opener is DRM master. Used by kiosks.
[[nodiscard]] std::shared_ptr<Session> make_direct_session();

/// Returns a session through libseat (seatd or logind), for a desktop's virtual terminals. Throws
/// Error(Device) if there is no seat or this build has no libseat.
[[nodiscard]] std::shared_ptr<Session> make_seat_session();

}  // namespace lenticule::display
