// SPDX-License-Identifier: Apache-2.0
// ControlLink sends requests to a player over its control socket. docs/play/control.md is the
// contract.
#pragma once

#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <semaphore>
#include <string>

#include "base/error.h"
#include "base/json_line_socket.h"
#include "base/unique_fd.h"

namespace lenticule::web {

/// LinkConnection is one connection to a player. Throws as JsonLineSocket does. Thread safety: one
/// thread.
class LinkConnection : public JsonLineSocket {
 public:
  LinkConnection(const std::string& socket, std::chrono::milliseconds timeout);
};

/// Each request has a connection of its own, so that a player that was restarted is found again.
///
/// Thread safety: any thread; at most four requests run at once, and others wait.
class ControlLink {
 public:
  explicit ControlLink(std::string socket) : socket_(std::move(socket)) {}

  struct Answer {
    nlohmann::ordered_json body;
    UniqueFd descriptor;
  };
  /// Returns the answer to a request without an id. Throws the player's error, or Error(Device) if
  /// there is no player or no answer within `timeout`.
  [[nodiscard]] Answer ask(nlohmann::ordered_json request,
                           std::chrono::milliseconds timeout = std::chrono::seconds(10));
  [[nodiscard]] const std::string& socket() const { return socket_; }

 private:
  const std::string socket_;
  std::counting_semaphore<4> slots_{4};
};

}  // namespace lenticule::web
