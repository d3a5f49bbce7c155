// SPDX-License-Identifier: Apache-2.0
#include "player/control/control_client.h"

#include <fmt/format.h>

#include <filesystem>
#include <vector>

#include "base/error.h"

namespace lenticule::player {
namespace {

namespace fs = std::filesystem;

/// Limit of an answer in bytes; answers of a player are far smaller.
constexpr size_t kMostBytes = 8u << 20;

}  // namespace

ControlClient::ControlClient(const std::string& socket, std::chrono::milliseconds timeout)
    : JsonLineSocket(socket, timeout,
                     {.most_bytes = kMostBytes,
                      .no_player = "start one: lenticule play SOURCE --rig RIG --control " + socket,
                      .gone = {}}) {}

std::string only_control_socket() {
  std::vector<std::string> found;
  std::error_code ignored;
  for (fs::directory_iterator entry("/run/lenticule", ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const fs::path socket = entry->path() / "control.sock";
    std::error_code missing;
    if (fs::is_socket(socket, missing)) found.push_back(socket.string());
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
