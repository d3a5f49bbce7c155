// SPDX-License-Identifier: Apache-2.0
#include "farm/json_fields.h"

#include <fmt/format.h>

#include "base/error.h"

namespace lenticule::farm {

using nlohmann::json;

json parse_json(std::string_view text, const std::string& source) {
  constexpr int kMaxDepth = 8;
  const auto shallow = [](int depth, json::parse_event_t, json&) { return depth <= kMaxDepth; };
  json object = json::parse(text, shallow, false);
  if (object.is_discarded())
    throw Error(ErrorKind::Input, fmt::format("{}: not JSON, or too deep", source));
  return object;
}

JsonFields::JsonFields(const json& object, std::string source)
    : object_(object), source_(std::move(source)) {
  if (!object_.is_object()) throw Error(ErrorKind::Input, source_ + ": not a JSON object");
}

void JsonFields::fail(const char* key, const std::string& cause) const {
  throw Error(ErrorKind::Input, fmt::format("{}: {}: {}", source_, key, cause));
}

const json& JsonFields::need(const char* key) const {
  const auto found = object_.find(key);
  if (found == object_.end()) fail(key, "missing");
  return *found;
}

std::string JsonFields::text(const char* key) const {
  const json& value = need(key);
  if (!value.is_string()) fail(key, "not a text");
  return value.get<std::string>();
}

uint64_t JsonFields::whole(const char* key, uint64_t most) const {
  const json& value = need(key);
  if (!value.is_number_unsigned() || value.get<uint64_t>() > most)
    fail(key, fmt::format("not a whole number of 0 to {}", most));
  return value.get<uint64_t>();
}

double JsonFields::number(const char* key) const {
  const json& value = need(key);
  if (!value.is_number() || !(value.get<double>() >= 0.0)) fail(key, "not a number from 0");
  return value.get<double>();
}

std::vector<std::string> JsonFields::texts(const char* key) const {
  const json& value = need(key);
  if (!value.is_array()) fail(key, "not a list");
  std::vector<std::string> texts;
  for (const json& one : value) {
    if (!one.is_string()) fail(key, "not a list of texts");
    texts.push_back(one.get<std::string>());
  }
  return texts;
}

}  // namespace lenticule::farm
