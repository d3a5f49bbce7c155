// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/trim_routes.h"

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "apps/lenticule-web/api/history.h"
#include "apps/lenticule-web/api/web_site.h"
#include "apps/lenticule-web/http/request_values.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

ordered_json present_trim(WebSite& site) {
  const ordered_json status = site.link().ask({{"do", "status"}}).body;
  if (!status.contains("trim") || !status["trim"].is_object())
    throw HttpError(409, "this player cannot change the trim");
  return status["trim"];
}

TrimEntry entry_of(const WebSite& site, const ordered_json& trim, const std::string& who) {
  return {.time = site.clock().date(),
          .who = who,
          .offset_lenses = trim.value("offset_lenses", 0.0),
          .pitch_relative = trim.value("pitch_relative", 0.0)};
}

ordered_json trim_json(WebSite& site, ordered_json trim) {
  trim["history"] = site.trims().to_json();
  return trim;
}

/// Sends the change to the player and returns its answer with the history.
ordered_json change_trim(WebSite& site, ordered_json question, const Request& request,
                         bool keeps = true) {
  // The values before the first change are the first entry, so that it can be undone.
  if (site.trims().to_json().empty())
    site.trims().add(entry_of(site, present_trim(site), "before"));
  question["do"] = "trim";
  ordered_json trim = site.link().ask(std::move(question)).body;
  if (keeps) site.trims().add(entry_of(site, trim, request.sender.name));
  site.player().refresh();
  return trim_json(site, std::move(trim));
}

Response get_trim(WebSite& site, const Request&, const std::string&) {
  return json_response(trim_json(site, present_trim(site)));
}
Response post_trim(WebSite& site, const Request& request, const std::string&) {
  const ordered_json body = json_body(request);
  ordered_json question;
  for (const auto& [key, field] : {std::pair("offset_by_lenses", "offset_by"),
                                   {"pitch_by_relative", "pitch_by"},
                                   {"offset_lenses", "offset"},
                                   {"pitch_relative", "pitch"}})
    if (const auto value = body_number(body, key)) question[field] = *value;
  if (question.is_null()) throw HttpError(400, "nothing to change");
  return json_response(change_trim(site, std::move(question), request));
}
Response set_trim(WebSite& site, const Request& request, const TrimEntry& entry, bool keeps) {
  return json_response(change_trim(
      site, {{"offset", entry.offset_lenses}, {"pitch", entry.pitch_relative}}, request, keeps));
}
Response post_trim_undo(WebSite& site, const Request& request, const std::string&) {
  const auto entry = site.trims().undo();
  if (!entry) throw HttpError(409, "there is nothing to undo");
  return set_trim(site, request, *entry, false);
}
Response post_trim_restore(WebSite& site, const Request& request, const std::string&) {
  const auto number = body_number(json_body(request), "number");
  const auto entry = site.trims().find(static_cast<uint64_t>(std::max(0.0, number.value_or(0.0))));
  if (!entry) throw HttpError(404, "there is no trim of that number");
  return set_trim(site, request, *entry, true);
}
Response post_trim_save(WebSite& site, const Request& request, const std::string&) {
  const std::string name = body_text(json_body(request), "name");
  if (name.empty()) throw HttpError(400, "name: missing");
  const ordered_json trim = present_trim(site);
  site.trims().name_newest(entry_of(site, trim, request.sender.name), name);
  return json_response(trim_json(site, trim));
}

constexpr std::array kTrimRoutes = {
    Route{"GET", "/api/v1/trim", Rights::See, 0, get_trim},
    Route{"POST", "/api/v1/trim", Rights::Change, kSmallBody, post_trim},
    Route{"POST", "/api/v1/trim/undo", Rights::Change, kSmallBody, post_trim_undo},
    Route{"POST", "/api/v1/trim/restore", Rights::Change, kSmallBody, post_trim_restore},
    Route{"POST", "/api/v1/trim/save", Rights::Change, kSmallBody, post_trim_save},
};

}  // namespace

std::span<const Route> trim_routes() {
  return kTrimRoutes;
}

}  // namespace lenticule::web
