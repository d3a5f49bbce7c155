// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/link/control_link.h"

#include <algorithm>

namespace lenticule::web {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::ordered_json;

constexpr size_t kMaxAnswer = 1u << 20;
constexpr const char* kRemedy = "start the player, or wait for it";

[[noreturn]] void fail(const std::string& socket, const std::string& cause) {
  throw Error(ErrorKind::Device, socket + ": " + cause, kRemedy);
}

[[noreturn]] void throw_error_of(const ordered_json& answer) {
  const auto error = answer.value("error", ordered_json::object());
  const auto text = [&](const char* key) {
    return error.is_object() && error.contains(key) && error[key].is_string()
               ? error[key].get<std::string>()
               : std::string();
  };
  const bool has_kind =
      error.is_object() && error.contains("kind") && error["kind"].is_number_integer();
  const int kind = has_kind ? error["kind"].get<int>() : 1;
  const std::string object = text("object");
  throw Error(kind >= 1 && kind <= 5 ? static_cast<ErrorKind>(kind) : ErrorKind::Failed,
              object.empty() ? text("cause") : object + ": " + text("cause"), text("remedy"));
}

}  // namespace

LinkConnection::LinkConnection(const std::string& socket, std::chrono::milliseconds timeout)
    : JsonLineSocket(socket, timeout,
                     {.most_bytes = kMaxAnswer, .no_player = kRemedy, .gone = kRemedy}) {}

ControlLink::Answer ControlLink::ask(ordered_json request, std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  if (!slots_.try_acquire_until(deadline)) fail(socket_, "the player is busy with other requests");
  struct Slot {
    std::counting_semaphore<4>& slots;
    ~Slot() { slots.release(); }
  } const slot{slots_};
  LinkConnection connection(socket_, timeout);
  request["id"] = 1;
  connection.send(request);
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
  auto body = connection.receive(std::max(left, std::chrono::milliseconds(0)));
  if (!body) fail(socket_, "no answer from the player");
  if (!body->contains("ok") || (*body)["ok"] != true) throw_error_of(*body);
  body->erase("id");
  body->erase("ok");
  return {.body = std::move(*body), .descriptor = connection.take_descriptor()};
}

}  // namespace lenticule::web
