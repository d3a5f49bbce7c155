// SPDX-License-Identifier: Apache-2.0
// The other end of a control socket: sends a request, waits a bounded time for lines.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/unique_fd.h"

namespace lenticule::player {

/// One thread.
class ControlClient {
 public:
  /// Throws Error(Device) if nobody listens there, within `patience`.
  ControlClient(const std::string& socket, std::chrono::milliseconds patience);

  /// Throws Error(Device) when the player went away.
  void send(const nlohmann::ordered_json& request);
  /// The next line; none if none came in time or `stop_fd` is readable. Throws Error(Device) when
  /// the player went away and Error(Failed) for what is no JSON object.
  [[nodiscard]] std::optional<nlohmann::ordered_json> receive(std::chrono::milliseconds patience,
                                                              int stop_fd = -1);

 private:
  [[nodiscard]] std::optional<nlohmann::ordered_json> take_line();

  std::string socket_;
  std::chrono::milliseconds patience_;
  UniqueFd fd_;
  std::string in_;
};

/// The socket of the only player that runs as a service on this machine. Throws Error(Usage) if
/// there is none, or more than one.
[[nodiscard]] std::string only_control_socket();

}  // namespace lenticule::player
