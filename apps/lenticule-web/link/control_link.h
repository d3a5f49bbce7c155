// SPDX-License-Identifier: Apache-2.0
// ControlLink sends requests to a player over its control socket. docs/play/control.md is the
// contract.
#pragma once

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <semaphore>
#include <string>

#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"
#include "base/error_kinds.h"
#include "base/json_line_socket.h"
#include "base/unique_fd.h"

namespace lenticule::web {

inline constexpr const char* kRemedy = "start the player, or wait for it";

/// Options of a connection to a player.
inline const JsonLineSocket::Options kLinkOptions{
    .most_bytes = 1u << 20, .no_player = kRemedy, .gone = kRemedy};

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
                           std::chrono::milliseconds timeout = std::chrono::seconds(10)) {
    timeout = AnswerTime::at_most(timeout);
    if (timeout.count() == 0) fail(socket_, "no answer from the player in time");
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    if (!slots_.try_acquire_until(deadline))
      fail(socket_, "the player is busy with other requests");
    struct Slot {
      std::counting_semaphore<4>& slots;
      ~Slot() { slots.release(); }
    } const slot{slots_};
    JsonLineSocket connection(socket_, timeout, kLinkOptions);
    request["id"] = 1;
    connection.send(request);
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    auto body = connection.receive(std::max(left, std::chrono::milliseconds(0)));
    if (!body) fail(socket_, "no answer from the player");
    if (!body->contains("ok") || (*body)["ok"] != true) throw_error_of(*body);
    body->erase("id");
    body->erase("ok");
    return {.body = std::move(*body), .descriptor = connection.take_descriptor()};
  }
  [[nodiscard]] const std::string& socket() const { return socket_; }

 private:
  [[noreturn]] static void fail(const std::string& socket, const std::string& cause) {
    throw device_error("{}: {}", socket, cause).remedy(kRemedy);
  }

  [[noreturn]] static void throw_error_of(const nlohmann::ordered_json& answer) {
    const nlohmann::ordered_json& error = member(answer, "error");
    const nlohmann::ordered_json& stated = member(error, "kind");
    const int kind = stated.is_number_integer() ? stated.get<int>() : 1;
    const std::string object = text_in(error, "object"), remedy = text_in(error, "remedy");
    const std::string cause = (object.empty() ? "" : object + ": ") + text_in(error, "cause");
    if (member(error, "conflict") == true) throw HttpError(409, cause, remedy);
    throw Error(kind >= 1 && kind <= 5 ? static_cast<ErrorKind>(kind) : ErrorKind::Failed, cause,
                remedy);
  }
  const std::string socket_;
  std::counting_semaphore<4> slots_{4};
};

/// Time of a request that opens content: a disk may be slow.
inline constexpr auto kOpeningTime = std::chrono::seconds(60);

/// Length of an interruption in seconds of content, the longest that the player accepts.
inline constexpr double kWhile = 1e6;

/// Shows something else than the content for a while. For the player this is an interruption, after
/// which it continues with its list at the same place.
inline void interrupt_with(ControlLink& link, const std::string& source) {
  (void)link.ask({{"do", "interrupt"}, {"source", source}, {"seconds", kWhile}}, kOpeningTime);
}
/// Ends an interruption, which may end by itself meanwhile.
inline void back_to_content(ControlLink& link) {
  try {
    (void)link.ask({{"do", "back"}}, kOpeningTime);
  } catch (const HttpError& error) {
    if (error.status() != 409) throw;
  }
}

inline bool is_chart(const std::string& source) {
  return source.ends_with("/calibration/chart.png");
}

/// Returns "black", "card", "views", "code" or "chart" if the player shows that instead of the
/// content; empty if it shows content.
[[nodiscard]] inline std::string shown_instead(const nlohmann::ordered_json& status) {
  const std::string source = text_in(member(status, "displayed"), "source");
  const nlohmann::ordered_json& items = member(member(status, "reading"), "items");
  if (items.is_number() && items > 1) return {};  // an item of a list may be black, too
  if (is_chart(source)) return "chart";
  const bool is_instead =
      source == "black" || source == "card" || source == "views" || source == "code";
  return is_instead ? source : std::string();
}

/// Shows "black", "card" or "views", or "content" again. Throws HttpError 400 for another word, 409
/// if there is no place to return to.
inline void show(ControlLink& link, const std::string& what) {
  if (what != "content" && what != "black" && what != "card" && what != "views")
    throw HttpError(400, "what: expected black, card, views or content");
  if (what != "content") return interrupt_with(link, what);
  const nlohmann::ordered_json status = link.ask({{"do", "status"}}).body;
  if (status.value("interrupted", nlohmann::ordered_json()).is_string())
    back_to_content(link);
  else if (!shown_instead(status).empty())
    throw HttpError(409, "it is not known what was played before", "load a list or a file");
}

}  // namespace lenticule::web
