// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/commands/show_address.h"

#include <poll.h>
#include <unistd.h>

#include <array>

#include "base/error.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::cli {
namespace {

using nlohmann::ordered_json;

constexpr size_t kMaxAddress = 500;
constexpr const char* kCode = "code";

[[noreturn]] void throw_error(const ordered_json& answer) {
  const auto text = [&](const char* key) {
    const auto error = answer.value("error", ordered_json::object());
    return error.is_object() ? error.value(key, std::string()) : std::string();
  };
  const auto error = answer.value("error", ordered_json::object());
  const int kind = error.is_object() ? error.value("kind", 1) : 1;
  const bool is_known =
      kind == static_cast<int>(ErrorKind::Usage) || kind == static_cast<int>(ErrorKind::Device);
  const std::string object = text("object");
  throw Error(is_known ? static_cast<ErrorKind>(kind) : ErrorKind::Failed,
              object.empty() ? text("cause") : object + ": " + text("cause"), text("remedy"));
}

std::string source_on_panel(const ordered_json& status) {
  const ordered_json place = status.value("on_glass", ordered_json());
  return place.is_object() ? place.value("source", std::string()) : std::string();
}

/// Returns the request that plays again what is played now, at its place.
ordered_json return_request(const ordered_json& status, const ordered_json& list) {
  ordered_json request = {{"do", "load"}, {"source", list.value("file", ordered_json())}};
  const ordered_json items = list.value("items", ordered_json::array());
  if (request["source"].is_null() && !items.empty())
    request["source"] = items.front().value("source", ordered_json());
  const ordered_json place = status.value("on_glass", ordered_json());
  for (const char* key : {"item", "frame"})
    if (place.is_object() && place.value(key, ordered_json()).is_number_unsigned())
      request[key] = place[key];
  return request;
}

}  // namespace

std::string address_from_input() {
  std::string text;
  std::array<char, 512> bytes{};
  while (text.find('\n') == std::string::npos && text.size() <= kMaxAddress) {
    const ssize_t got = ::read(STDIN_FILENO, bytes.data(), bytes.size());
    if (got <= 0) break;
    text.append(bytes.data(), static_cast<size_t>(got));
  }
  text = text.substr(0, text.find('\n'));
  if (text.empty())
    throw Error(ErrorKind::Usage, "show-address: no address",
                ::isatty(STDIN_FILENO) == 1
                    ? "give one, or: lenticule web address | lenticule ctl show-address"
                    : "the command before the pipe printed none; its message has the reason");
  return text;
}

ordered_json ask(player::ControlClient& client, const ordered_json& request,
                 std::chrono::milliseconds answer_time, int stop_fd) {
  ordered_json numbered = {{"id", 1}};
  numbered.update(request);
  client.send(numbered);
  const auto answer = client.receive(answer_time, stop_fd);
  if (!answer && stop_fd >= 0 && player::interrupted()) return nullptr;
  if (!answer)
    throw Error(ErrorKind::Failed, "ctl: no answer from the player",
                "the player may still be working on it; --wait sets how long to wait");
  if (!answer->value("ok", false)) throw_error(*answer);
  return *answer;
}

ExitCode show_address(const std::string& socket, const std::string& address,
                      std::chrono::milliseconds duration, std::chrono::milliseconds answer_time) {
  // A connection that stays idle may be displaced by others.
  const auto answer_to = [&](const ordered_json& request) {
    player::ControlClient client(socket, answer_time);
    return ask(client, request, answer_time, -1);
  };
  const ordered_json status = answer_to({{"do", "status"}});
  if (source_on_panel(status) == kCode)
    throw Error(ErrorKind::Failed, "show-address: the panel shows a code already",
                "wait until it ends");
  const ordered_json before = return_request(status, answer_to({{"do", "list"}}));
  (void)answer_to({{"do", "load"}, {"source", std::string(kCode) + ":" + address}});
  say("the code is on the panel for {} s, or until Ctrl-C\n", duration.count() / 1000);
  pollfd entry{.fd = player::interrupt_fd(), .events = POLLIN, .revents = 0};
  (void)::poll(&entry, 1, static_cast<int>(duration.count()));
  // Another client may have loaded something else meanwhile.
  if (source_on_panel(answer_to({{"do", "status"}})) != kCode) return kOk;
  try {
    (void)answer_to(before);
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::Device) throw;
    // The list or the film may have become shorter.
    (void)answer_to({{"do", "load"}, {"source", before["source"]}});
  }
  return kOk;
}

}  // namespace lenticule::cli
