// SPDX-License-Identifier: Apache-2.0
// The client end of a control socket sends requests and waits a bounded time for lines.
#pragma once

#include <chrono>
#include <string>

#include "base/json_line_socket.h"

namespace lenticule::player {

/// ControlClient is a connection to the control socket of a player. Throws as JsonLineSocket does.
/// Thread safety: one thread.
class ControlClient : public JsonLineSocket {
 public:
  ControlClient(const std::string& socket, std::chrono::milliseconds timeout);
};

/// Returns the socket of the only player that runs as a service on this machine. Throws
/// Error(Device) if there is none, Error(Usage) if there are several.
[[nodiscard]] std::string only_control_socket();

}  // namespace lenticule::player
