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
  /// there is no player or no answer within `timeout` and the AnswerTime of this thread.
  [[nodiscard]] Answer ask(nlohmann::ordered_json request,
                           std::chrono::milliseconds timeout = std::chrono::seconds(10));
  [[nodiscard]] const std::string& socket() const { return socket_; }

 private:
  const std::string socket_;
  std::counting_semaphore<4> slots_{4};
};

/// Time of a request that opens content: a disk may be slow.
inline constexpr auto kOpeningTime = std::chrono::seconds(60);

/// Shows something else than the content for a while. For the player this is an interruption, after
/// which it continues with its list at the same place.
void interrupt_with(ControlLink& link, const std::string& source);
/// Shows "black", "card" or "views", or "content" again. Throws HttpError 400 for another word, 409
/// if there is no place to return to.
void show(ControlLink& link, const std::string& what);
/// Returns "black", "card", "views", "code" or "chart" if the player shows that instead of the
/// content; empty if it shows content.
[[nodiscard]] std::string shown_instead(const nlohmann::ordered_json& status);

}  // namespace lenticule::web
