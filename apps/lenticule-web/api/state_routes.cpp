// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/state_routes.h"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <utility>

#include "apps/lenticule-web/api/metrics.h"
#include "apps/lenticule-web/api/web_site.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr auto kHeartbeat = std::chrono::seconds(10);

/// StateEvents sends the whole state first, then the messages as they come.
class StateEvents final : public EventStream {
 public:
  StateEvents(PlayerState& player, uint64_t after, std::string first)
      : player_(player), after_(after), first_(std::move(first)) {}

  std::optional<std::string> next() override {
    if (!first_.empty()) return std::exchange(first_, {});
    const std::vector<Message> messages = player_.wait_for(after_, kHeartbeat);
    if (player_.stopped()) return std::nullopt;
    std::string text;
    for (const Message& message : messages) {
      after_ = message.number;
      text += fmt::format("id: {}\nevent: {}\ndata: {}\n\n", message.number, escaped(message.name),
                          message.text);
    }
    return text.empty() ? ": nothing new\n\n" : text;
  }

 private:
  PlayerState& player_;
  uint64_t after_;
  std::string first_;
};

Response get_state(WebSite& site, const Request& request, const std::string&) {
  return json_response(state_json(site, request));
}

Response get_events(WebSite& site, const Request& request, const std::string&) {
  const uint64_t newest = site.player().newest();
  Response response;
  response.type = "text/event-stream";
  response.headers.emplace_back("X-Accel-Buffering", "no");
  response.events =
      std::make_unique<StateEvents>(site.player(), newest,
                                    fmt::format("retry: 2000\nid: {}\nevent: state\ndata: {}\n\n",
                                                newest, json_text(state_json(site, request))));
  return response;
}

Response get_health(WebSite& site, const Request&, const std::string&) {
  return json_response(health_json(site.player()));
}
Response get_report(WebSite& site, const Request& request, const std::string&) {
  Response response = json_response({{"time", site.clock().date()},
                                     {"version", LENTICULE_VERSION},
                                     {"state", state_json(site, request)},
                                     {"health", health_json(site.player())},
                                     {"statistics", site.player().statistics()},
                                     {"trims", site.trims().to_json()}});
  response.headers.emplace_back("Content-Disposition",
                                "attachment; filename=\"lenticule-report.json\"");
  return response;
}
Response get_metrics(WebSite& site, const Request&, const std::string&) {
  Response response;
  response.type = "text/plain; version=0.0.4; charset=utf-8";
  response.body = metrics_text(site.player());
  return response;
}

constexpr std::array kStateRoutes = {
    Route{"GET", "/metrics", Rights::See, 0, get_metrics},
    Route{"GET", "/api/v1/state", Rights::See, 0, get_state},
    Route{"GET", "/api/v1/events", Rights::See, 0, get_events},
    Route{"GET", "/api/v1/health", Rights::See, 0, get_health},
    Route{"GET", "/api/v1/report", Rights::See, 0, get_report},
};

}  // namespace

std::span<const Route> state_routes() {
  return kStateRoutes;
}

nlohmann::ordered_json state_json(WebSite& site, const Request& request) {
  ordered_json state = site.player().state();
  state["shown_instead"] = ShownInstead::shown(state["status"]);
  state["rights"] = rights_name(request.sender.rights);
  state["name"] = request.sender.name;
  state["machine"] = machine_json();
  return state;
}

}  // namespace lenticule::web
