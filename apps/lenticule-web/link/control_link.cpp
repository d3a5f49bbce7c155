// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/link/control_link.h"

#include <algorithm>

#include "apps/lenticule-web/http/clock.h"
#include "apps/lenticule-web/http/message.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;
using std::chrono::steady_clock;

constexpr size_t kMaxAnswer = 1u << 20;
/// Length of an interruption in seconds of content, the longest that the player accepts.
constexpr double kWhile = 1e6;
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
  const std::string cause = object.empty() ? text("cause") : object + ": " + text("cause");
  if (error.is_object() && error.contains("conflict") && error["conflict"] == true)
    throw HttpError(409, cause, text("remedy"));
  throw Error(kind >= 1 && kind <= 5 ? static_cast<ErrorKind>(kind) : ErrorKind::Failed, cause,
              text("remedy"));
}

bool is_chart(const std::string& source) {
  return source.ends_with("/calibration/chart.png");
}

/// Ends an interruption, which may end by itself meanwhile.
void back_to_content(ControlLink& link) {
  try {
    (void)link.ask({{"do", "back"}}, kOpeningTime);
  } catch (const HttpError& error) {
    if (error.status() != 409) throw;
  }
}

}  // namespace

LinkConnection::LinkConnection(const std::string& socket, std::chrono::milliseconds timeout)
    : JsonLineSocket(socket, timeout,
                     {.most_bytes = kMaxAnswer, .no_player = kRemedy, .gone = kRemedy}) {}

ControlLink::Answer ControlLink::ask(ordered_json request, std::chrono::milliseconds timeout) {
  timeout = AnswerTime::at_most(timeout);
  if (timeout.count() == 0) fail(socket_, "no answer from the player in time");
  const auto deadline = steady_clock::now() + timeout;
  if (!slots_.try_acquire_until(deadline)) fail(socket_, "the player is busy with other requests");
  struct Slot {
    std::counting_semaphore<4>& slots;
    ~Slot() { slots.release(); }
  } const slot{slots_};
  LinkConnection connection(socket_, timeout);
  request["id"] = 1;
  connection.send(request);
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - steady_clock::now());
  auto body = connection.receive(std::max(left, std::chrono::milliseconds(0)));
  if (!body) fail(socket_, "no answer from the player");
  if (!body->contains("ok") || (*body)["ok"] != true) throw_error_of(*body);
  body->erase("id");
  body->erase("ok");
  return {.body = std::move(*body), .descriptor = connection.take_descriptor()};
}

// --- what is shown instead of the content ---------------------------------------------------

std::string shown_instead(const ordered_json& status) {
  const auto place = status.is_object() ? status.find("displayed") : status.end();
  if (!status.is_object() || place == status.end() || !place->is_object() ||
      !place->contains("source") || !(*place)["source"].is_string())
    return {};
  const auto source = (*place)["source"].get<std::string>();
  // An item of a list may be black, too.
  const bool in_list = status.contains("reading") && status["reading"].is_object() &&
                       status["reading"].value("items", 0) > 1;
  if (in_list) return {};
  if (is_chart(source)) return "chart";
  const bool is_instead =
      source == "black" || source == "card" || source == "views" || source == "code";
  return is_instead ? source : std::string();
}

void interrupt_with(ControlLink& link, const std::string& source) {
  (void)link.ask({{"do", "interrupt"}, {"source", source}, {"seconds", kWhile}}, kOpeningTime);
}

void show(ControlLink& link, const std::string& what) {
  if (what != "content" && what != "black" && what != "card" && what != "views")
    throw HttpError(400, "what: expected black, card, views or content");
  if (what != "content") return interrupt_with(link, what);
  const ordered_json status = link.ask({{"do", "status"}}).body;
  if (status.value("interrupted", ordered_json()).is_string())
    back_to_content(link);
  else if (!shown_instead(status).empty())
    throw HttpError(409, "it is not known what was played before", "load a list or a file");
}

}  // namespace lenticule::web
