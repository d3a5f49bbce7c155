// SPDX-License-Identifier: Apache-2.0
// How a card is opened, and whether it is ours at the moment.
#pragma once

#include <memory>
#include <string>

#include "base/unique_fd.h"

namespace lenticule::display {

enum class Mastership {
  Held,    ///< commits are ours to make
  Denied,  ///< not allowed (EACCES): another session is in front, or somebody opened it first
  Busy,    ///< another program is master (EBUSY)
};

/// One thread, apart from open_device(), which may be called before there is one.
class Session {
 public:
  virtual ~Session() = default;
  /// Throws Error(Device) naming the path.
  [[nodiscard]] virtual UniqueFd open_device(const std::string& path) = 0;
  /// Called before the descriptor is closed.
  virtual void close_device(int fd) noexcept = 0;
  /// Whether we are master of the card, after trying to become it.
  [[nodiscard]] virtual Mastership ensure_master(int fd) noexcept = 0;
  virtual void drop_master(int fd) noexcept = 0;
  /// Readable when dispatch() has something to do; -1 if it never has.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }
  /// Handles what the seat's keeper says. False while the seat is not ours.
  [[nodiscard]] virtual bool dispatch() noexcept { return true; }
};

/// Opens nodes by itself: the first opener is master. What a kiosk uses.
[[nodiscard]] std::shared_ptr<Session> make_direct_session();

/// Through libseat (seatd or logind), for a desktop's virtual terminals. Throws Error(Device) when
/// there is no seat, or when this build has no libseat.
[[nodiscard]] std::shared_ptr<Session> make_seat_session();

}  // namespace lenticule::display
