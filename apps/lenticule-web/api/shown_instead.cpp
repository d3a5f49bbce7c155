// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/shown_instead.h"

#include <chrono>

#include "apps/lenticule-web/http/message.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;
using std::chrono::seconds;

constexpr auto kLoadTime = seconds(60);
/// Length of an interruption in seconds of content, the longest that the player accepts.
constexpr double kWhile = 1e6;

bool is_chart(const std::string& source) {
  return source.ends_with("/calibration/chart.png");
}

bool is_instead(const std::string& source) {
  return source == "black" || source == "card" || source == "views" || source == "code" ||
         is_chart(source);
}

}  // namespace

std::string ShownInstead::shown(const ordered_json& status) {
  const auto place = status.is_object() ? status.find("on_glass") : status.end();
  if (!status.is_object() || place == status.end() || !place->is_object() ||
      !place->contains("source") || !(*place)["source"].is_string())
    return {};
  const auto source = (*place)["source"].get<std::string>();
  // An item of a list may be black, too.
  const bool in_list = status.contains("taking") && status["taking"].is_object() &&
                       status["taking"].value("items", 0) > 1;
  if (in_list || !is_instead(source)) return {};
  return is_chart(source) ? "chart" : source;
}

void ShownInstead::show_chart(const std::filesystem::path& file) {
  interrupt(file.string());
}

void ShownInstead::interrupt(const std::string& source) {
  (void)link_.ask({{"do", "interrupt"}, {"source", source}, {"seconds", kWhile}}, kLoadTime);
}

void ShownInstead::show(const std::string& what) {
  if (what != "content" && what != "black" && what != "card" && what != "views")
    throw HttpError(400, "what: expected black, card, views or content");
  if (what != "content") return interrupt(what);
  const ordered_json status = link_.ask({{"do", "status"}}).body;
  if (status.value("interrupted", ordered_json()).is_string())
    (void)link_.ask({{"do", "back"}}, kLoadTime);
  else if (!shown(status).empty())
    throw HttpError(409, "it is not known what was played before", "load a list or a file");
}

}  // namespace lenticule::web
