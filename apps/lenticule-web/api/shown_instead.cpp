// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/shown_instead.h"

#include <chrono>

#include "apps/lenticule-web/http/message.h"
#include "base/file.h"
#include "base/text.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;
using std::chrono::seconds;

constexpr auto kLoadTime = seconds(60);

bool is_chart(const std::string& source) {
  return source.ends_with("/calibration/chart.png");
}

bool is_instead(const std::string& source) {
  return source == "black" || source == "card" || source == "views" || source == "code" ||
         is_chart(source);
}

}  // namespace

ShownInstead::ShownInstead(ControlLink& link, std::filesystem::path file)
    : link_(link), file_(std::move(file)) {}

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
  const std::lock_guard lock(mutex_);
  locked_show(file.string());
}

/// Keeps the place of the content, and shows `source`.
void ShownInstead::locked_show(const std::string& source) {
  const ordered_json status = link_.ask({{"do", "status"}}).body;
  if (shown(status).empty()) {
    const ordered_json list = link_.ask({{"do", "list"}}).body;
    const auto place = status.value("on_glass", ordered_json());
    ordered_json kept = {{"source", list["file"]}, {"item", 0}, {"frame", 0}};
    if (kept["source"].is_null() && !list["items"].empty())
      kept["source"] = list["items"][0]["source"];
    if (place.is_object()) {
      if (place.value("item", ordered_json()).is_number_unsigned()) kept["item"] = place["item"];
      if (place.value("frame", ordered_json()).is_number_unsigned()) kept["frame"] = place["frame"];
    }
    write_text_file(file_, json_text(kept) + "\n");
  }
  (void)link_.ask({{"do", "load"}, {"source", source}}, kLoadTime);
}

void ShownInstead::show(const std::string& what) {
  if (what != "content" && what != "black" && what != "card" && what != "views")
    throw HttpError(400, "what: expected black, card, views or content");
  const std::lock_guard lock(mutex_);
  if (what != "content") return locked_show(what);
  const ordered_json status = link_.ask({{"do", "status"}}).body;
  if (shown(status).empty()) return;
  // 'blank' of another client: the player itself knows the place before.
  if (status.value("interrupted", ordered_json()).is_string()) {
    (void)link_.ask({{"do", "back"}}, kLoadTime);
    return;
  }
  const ordered_json kept = std::filesystem::exists(file_)
                                ? ordered_json::parse(read_text_file(file_, 16384), nullptr, false)
                                : ordered_json();
  if (!kept.is_object() || !kept.contains("source") || !kept["source"].is_string())
    throw HttpError(409, "it is not known what was played before", "load a list or a file");
  ordered_json load = {{"do", "load"}, {"source", kept["source"]}};
  try {
    ordered_json there = load;
    there["item"] = kept.value("item", ordered_json(0));
    there["frame"] = kept.value("frame", ordered_json(0));
    (void)link_.ask(std::move(there), kLoadTime);
  } catch (const Error& error) {
    // The list or the film may have become shorter.
    if (error.kind() == ErrorKind::Device) throw;
    (void)link_.ask(std::move(load), kLoadTime);
  }
}

}  // namespace lenticule::web
