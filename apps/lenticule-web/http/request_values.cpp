// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/http/request_values.h"

#include <fmt/format.h>

#include <cmath>

#include "base/numbers.h"

namespace lenticule::web {
namespace {

using nlohmann::ordered_json;

}  // namespace

ordered_json json_body(const Request& request) {
  if (request.body.empty()) return ordered_json::object();
  ordered_json body = ordered_json::parse(request.body, nullptr, false);
  if (!body.is_object()) throw HttpError(400, "the body is not a JSON object");
  return body;
}

std::optional<double> body_number(const ordered_json& body, const char* key) {
  if (!body.contains(key)) return std::nullopt;
  if (!body[key].is_number() || !std::isfinite(body[key].get<double>()))
    throw HttpError(400, fmt::format("{}: not a number", key));
  return body[key].get<double>();
}

std::string body_text(const ordered_json& body, const char* key) {
  if (!body.contains(key) || !body[key].is_string() || body[key].get<std::string>().size() > 4096)
    throw HttpError(400, fmt::format("{}: missing, or not a text", key));
  return body[key].get<std::string>();
}

double query_number(const Request& request, const char* key, std::optional<double> otherwise) {
  const auto text = request.query(key);
  if (!text && otherwise) return *otherwise;
  const auto value = number_from<double>(text.value_or(""));
  if (!value || std::abs(*value) > 1e6)
    throw HttpError(400, fmt::format("{}: missing, or not a number", key));
  return *value;
}

}  // namespace lenticule::web
