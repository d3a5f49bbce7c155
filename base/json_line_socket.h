// SPDX-License-Identifier: Apache-2.0
// JsonLineSocket is the client end of a Unix socket over which each side sends lines of JSON:
// the control socket of a player. No call waits longer than it is told.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "base/unique_fd.h"

namespace lenticule {

/// Thread safety: one thread.
class JsonLineSocket {
 public:
  struct Options {
    size_t most_bytes;      ///< limit of a line; a longer one means that the peer is no player
    std::string no_player;  ///< remedy if nothing listens
    std::string gone;       ///< remedy if the player closes the connection
  };
  /// Throws Error(Device) if no player accepts the connection within `timeout`.
  JsonLineSocket(const std::string& socket, std::chrono::milliseconds timeout, Options options);

  /// Throws Error(Device) if the player does not read. Returns normally if the player closed the
  /// connection: the reason may still be read.
  void send(const nlohmann::ordered_json& request);
  /// Returns the next line; none if no line arrived in time or `stop_fd` is readable. Throws
  /// Error(Device) if the player closed the connection and Error(Failed) if the line is not a JSON
  /// object.
  [[nodiscard]] std::optional<nlohmann::ordered_json> receive(std::chrono::milliseconds timeout,
                                                              int stop_fd = -1);
  /// Returns the descriptor that arrived with the last lines; empty if none did.
  [[nodiscard]] UniqueFd take_descriptor() { return std::move(descriptor_); }

 private:
  [[nodiscard]] std::optional<nlohmann::ordered_json> take_line();
  [[nodiscard]] bool read_more();
  [[noreturn]] void fail_gone() const;
  [[noreturn]] void fail_to_connect(int error) const;

  std::string socket_;
  std::chrono::milliseconds timeout_;
  Options options_;
  UniqueFd fd_;
  UniqueFd descriptor_;
  std::string in_;
};

}  // namespace lenticule
