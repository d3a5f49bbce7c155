// SPDX-License-Identifier: Apache-2.0
// The client end of a control socket sends requests and waits a bounded time for lines.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/unique_fd.h"

namespace lenticule::player {

/// Thread safety: one thread.
class ControlClient {
 public:
  /// Throws Error(Device) if no player accepts the connection within `timeout`.
  ControlClient(const std::string& socket, std::chrono::milliseconds timeout);

  /// Throws Error(Device) if the player closed the connection.
  void send(const nlohmann::ordered_json& request);
  /// Returns the next line; none if no line arrived in time or `stop_fd` is readable. Throws
  /// Error(Device) if the player closed the connection and Error(Failed) if the line is not a JSON
  /// object.
  [[nodiscard]] std::optional<nlohmann::ordered_json> receive(std::chrono::milliseconds timeout,
                                                              int stop_fd = -1);

 private:
  [[nodiscard]] std::optional<nlohmann::ordered_json> take_line();

  std::string socket_;
  std::chrono::milliseconds timeout_;
  UniqueFd fd_;
  std::string in_;
};

/// Returns the socket of the only player that runs as a service on this machine. Throws
/// Error(Usage) if there is none or more than one.
[[nodiscard]] std::string only_control_socket();

}  // namespace lenticule::player
