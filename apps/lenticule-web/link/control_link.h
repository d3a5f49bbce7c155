// SPDX-License-Identifier: Apache-2.0
// ControlLink sends requests to a player over its control socket. docs/control.md is the contract.
#pragma once

#include <chrono>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <semaphore>
#include <string>

#include "base/error.h"
#include "base/unique_fd.h"

namespace lenticule::web {

/// LinkConnection is one connection to a player. Thread safety: one thread.
class LinkConnection {
 public:
  /// Throws Error(Device) if no player accepts the connection within `timeout`.
  LinkConnection(const std::string& socket, std::chrono::milliseconds timeout);

  /// Throws Error(Device) if the player closed the connection.
  void send(const nlohmann::ordered_json& request);
  /// Returns the next line; none if no line arrived in time or `stop_fd` is readable. Throws
  /// Error(Device) if the player closed the connection, and if the line is not a JSON object.
  [[nodiscard]] std::optional<nlohmann::ordered_json> receive(std::chrono::milliseconds timeout,
                                                              int stop_fd = -1);
  /// Returns the descriptor that arrived with the last lines; empty if none did.
  [[nodiscard]] UniqueFd take_descriptor() { return std::move(descriptor_); }

 private:
  [[nodiscard]] std::optional<nlohmann::ordered_json> take_line();
  [[nodiscard]] bool read_more();

  std::string socket_;
  std::chrono::milliseconds timeout_;
  UniqueFd fd_;
  UniqueFd descriptor_;
  std::string in_;
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
