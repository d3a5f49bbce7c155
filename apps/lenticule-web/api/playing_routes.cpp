// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/playing_routes.h"

#include <array>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "apps/lenticule-web/api/state_routes.h"
#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/request_values.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

constexpr auto kJumpTime = std::chrono::seconds(60);

Response ask_player(WebSite& site, ordered_json question) {
  ordered_json answer = site.link().ask(std::move(question), kJumpTime).body;
  site.player().refresh();
  return json_response(answer);
}
template <const char* kVerb>
Response post_verb(WebSite& site, const Request&, const std::string&) {
  return ask_player(site, {{"do", kVerb}});
}
constexpr char kPlay[] = "play";
constexpr char kPause[] = "pause";
constexpr char kNext[] = "next";
constexpr char kPrevious[] = "previous";
constexpr char kBlank[] = "blank";
constexpr char kBack[] = "back";
constexpr char kGo[] = "go";

Response post_seek(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "seek"}};
  const ordered_json body = json_body(request);
  for (const char* key : {"item", "frame"})
    if (body.contains(key)) question[key] = body[key];
  return ask_player(site, std::move(question));
}

/// Adds the target of an interruption or a cue: an item of the list, or a file of the media folder.
void put_target(WebSite& site, const ordered_json& body, ordered_json& question) {
  for (const char* key : {"item", "frame", "seconds", "then_back"})
    if (body.contains(key)) question[key] = body[key];
  if (body.contains("file"))
    question["source"] = site.media().path_of(body_text(body, "file")).string();
}

Response post_interrupt(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "interrupt"}};
  put_target(site, json_body(request), question);
  return ask_player(site, std::move(question));
}

Response post_cue(WebSite& site, const Request& request, const std::string&) {
  ordered_json question = {{"do", "cue"}};
  put_target(site, json_body(request), question);
  return ask_player(site, std::move(question));
}

Response post_speed(WebSite& site, const Request& request, const std::string&) {
  const auto factor = body_number(json_body(request), "factor");
  if (!factor) throw HttpError(400, "factor: missing");
  return ask_player(site, {{"do", "speed"}, {"factor", *factor}});
}

Response post_power(WebSite& site, const Request& request, const std::string&) {
  return ask_player(site, {{"do", "power"}, {"to", body_text(json_body(request), "to")}});
}

Response post_show(WebSite& site, const Request& request, const std::string&) {
  site.shown_instead().show(body_text(json_body(request), "what"));
  site.player().refresh();
  return json_response(state_json(site, request));
}

constexpr std::array kPlayingRoutes = {
    Route{"POST", "/api/v1/play", Rights::Change, kSmallBody, post_verb<kPlay>},
    Route{"POST", "/api/v1/pause", Rights::Change, kSmallBody, post_verb<kPause>},
    Route{"POST", "/api/v1/next", Rights::Change, kSmallBody, post_verb<kNext>},
    Route{"POST", "/api/v1/previous", Rights::Change, kSmallBody, post_verb<kPrevious>},
    Route{"POST", "/api/v1/seek", Rights::Change, kSmallBody, post_seek},
    Route{"POST", "/api/v1/interrupt", Rights::Change, kSmallBody, post_interrupt},
    Route{"POST", "/api/v1/blank", Rights::Change, kSmallBody, post_verb<kBlank>},
    Route{"POST", "/api/v1/back", Rights::Change, kSmallBody, post_verb<kBack>},
    Route{"POST", "/api/v1/cue", Rights::Change, kSmallBody, post_cue},
    Route{"POST", "/api/v1/go", Rights::Change, kSmallBody, post_verb<kGo>},
    Route{"POST", "/api/v1/speed", Rights::Change, kSmallBody, post_speed},
    Route{"POST", "/api/v1/power", Rights::Change, kSmallBody, post_power},
    Route{"POST", "/api/v1/show", Rights::Change, kSmallBody, post_show},
};

}  // namespace

std::span<const Route> playing_routes() {
  return kPlayingRoutes;
}

}  // namespace lenticule::web
