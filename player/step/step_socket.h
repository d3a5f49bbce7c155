// SPDX-License-Identifier: Apache-2.0
// StepSocket carries datagrams between the players of a group: UDP between machines, or a Unix
// socket between players of one user on one machine.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <optional>
#include <span>
#include <string>

#include "base/unique_fd.h"
#include "frames/ring/listen_socket.h"
#include "player/step/step_message.h"

namespace lenticule::player {

/// The address of a socket.
struct StepEndpoint {
  sockaddr_storage address{};
  socklen_t bytes = 0;
};

/// The address of a group's leader, from --step-address.
struct StepAddress {
  std::string text;
  bool is_unix = false;
  StepEndpoint endpoint;
};
/// Parses "ADDRESS:PORT", "[ADDRESS]:PORT", or the path of a Unix socket, which has a slash. Throws
/// Error(Usage).
[[nodiscard]] StepAddress parse_step_address(const std::string& text);

/// Thread safety: one thread.
class StepSocket {
 public:
  /// Binds the address as the leader, or any free address as a follower. Throws Error(Device) if
  /// the address is in use or not this machine's, Error(Failed) otherwise.
  StepSocket(const StepAddress& address, bool leader);

  [[nodiscard]] int fd() const noexcept { return fd_; }

  struct Datagram {
    std::span<const uint8_t> bytes;  ///< valid until the next call
    StepEndpoint from;
  };
  /// Returns the next waiting datagram. Datagrams of other users on a Unix socket are left out.
  [[nodiscard]] std::optional<Datagram> receive() noexcept;
  /// Sends without waiting; a datagram that cannot be sent is lost.
  void send(const StepEndpoint& to, std::span<const uint8_t> bytes) const noexcept;

 private:
  /// One byte more than a message, so that a longer datagram is noticed.
  std::array<uint8_t, kStepMessageBytes + 1> buffer_{};
  std::optional<frames::ListenSocket> listening_;  ///< the leader's Unix socket
  UniqueFd own_;
  int fd_ = -1;
  bool is_unix_ = false;
};

}  // namespace lenticule::player
