// SPDX-License-Identifier: Apache-2.0
// The client end of a control socket sends requests and waits a bounded time for lines.
#pragma once

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/json_line_socket.h"

namespace lenticule::player {

/// ControlClient is a connection to the control socket of a player. Throws as JsonLineSocket does.
/// Thread safety: one thread.
class ControlClient : public JsonLineSocket {
 public:
  ControlClient(const std::string& socket, std::chrono::milliseconds timeout)
      : JsonLineSocket(
            socket, timeout,
            {.most_bytes = kMostBytes,
             .no_player = "start one: lenticule play SOURCE --rig RIG --control " + socket,
             .gone = {}}) {}

 private:
  /// Limit of an answer in bytes; answers of a player are far smaller.
  static constexpr size_t kMostBytes = 8u << 20;
};

/// Returns the socket of the only player that runs as a service on this machine. Throws
/// Error(Device) if there is none, Error(Usage) if there are several.
[[nodiscard]] inline std::string only_control_socket() {
  std::vector<std::string> found;
  std::error_code ignored;
  for (std::filesystem::directory_iterator entry("/run/lenticule", ignored), end;
       !ignored && entry != end; entry.increment(ignored)) {
    const std::filesystem::path socket = entry->path() / "control.sock";
    std::error_code missing;
    if (std::filesystem::is_socket(socket, missing)) found.push_back(socket.string());
  }
  if (found.size() == 1) return found.front();
  if (found.empty())
    throw Error(ErrorKind::Device, "--socket: no player service runs on this machine",
                "give the socket of a player: lenticule play ... --control SOCKET");
  throw Error(ErrorKind::Usage,
              fmt::format("--socket: {} player services run on this machine", found.size()),
              "give the socket of one: --socket " + found.front());
}

}  // namespace lenticule::player
