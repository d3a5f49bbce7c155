// SPDX-License-Identifier: Apache-2.0
#include "optics/json_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMostTextBytes = 1024;

}  // namespace

JsonFields::JsonFields(const nlohmann::json& object, std::string source, std::string remedy)
    : object_(object), source_(std::move(source)), remedy_(std::move(remedy)) {
  if (!object.is_object()) throw Error(ErrorKind::Input, source_ + ": not a JSON object", remedy_);
}

const nlohmann::json* JsonFields::find(const std::string& key) const {
  const auto it = object_.find(key);
  if (it == object_.end() || it->is_null()) return nullptr;
  if (!it->is_object()) return &*it;
  const auto wrapped = it->find("value");
  return wrapped != it->end() ? &*wrapped : &*it;
}

const nlohmann::json& JsonFields::need(const std::string& key) const {
  const nlohmann::json* value = find(key);
  if (value == nullptr) fail(key, "missing");
  return *value;
}

double JsonFields::number(const std::string& key, double least, double most) const {
  const nlohmann::json& value = need(key);
  if (!value.is_number()) fail(key, "not a number");
  const double number = value.get<double>();
  if (!std::isfinite(number)) fail(key, "not finite");
  if (!(number >= least && number <= most)) fail(key, fmt::format("not in {} to {}", least, most));
  return number;
}

double JsonFields::number_or(const std::string& key, double otherwise, double least,
                             double most) const {
  return find(key) != nullptr ? number(key, least, most) : otherwise;
}

int JsonFields::count(const std::string& key, int most) const {
  const double value = number(key);
  if (!(value >= 1.0 && value <= most && value == std::floor(value)))
    fail(key, fmt::format("not a whole number of 1 to {}", most));
  return static_cast<int>(value);
}

uint64_t JsonFields::whole(const std::string& key, uint64_t most,
                           const nlohmann::json* value) const {
  if (value == nullptr) value = &need(key);
  if (!value->is_number_unsigned() || value->get<uint64_t>() > most)
    fail(key, fmt::format("not a whole number of 0 to {}", most));
  return value->get<uint64_t>();
}

bool JsonFields::flag(const std::string& key) const {
  const nlohmann::json* value = find(key);
  if (value == nullptr) return false;
  return value->is_boolean() ? value->get<bool>() : number(key) != 0.0;
}

std::string JsonFields::text(const std::string& key) const {
  const nlohmann::json& value = need(key);
  if (!value.is_string()) fail(key, "not a string");
  return value.get<std::string>();
}

std::string JsonFields::text_or(const std::string& key, const std::string& otherwise) const {
  return find(key) != nullptr ? text(key) : otherwise;
}

std::vector<std::string> JsonFields::texts(const std::string& key) const {
  const nlohmann::json& value = need(key);
  const auto is_text = [](const nlohmann::json& item) { return item.is_string(); };
  if (!value.is_array() || !std::all_of(value.begin(), value.end(), is_text))
    fail(key, "not a list of strings");
  return value.get<std::vector<std::string>>();
}

void JsonFields::fail(const std::string& key, const std::string& cause) const {
  throw Error(ErrorKind::Input, fmt::format("{}: {}: {}", source_, key, cause), remedy_);
}

nlohmann::json parse_json(std::string_view text, const std::string& source,
                          const std::string& remedy) {
  // Deep nesting takes many times the memory of its text.
  constexpr int kMaxDepth = 16;
  bool is_deep = false;
  const auto shallow = [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    is_deep = is_deep || depth > kMaxDepth;
    return !is_deep;
  };
  try {
    nlohmann::json document = nlohmann::json::parse(text, shallow);
    if (!is_deep) return document;
    throw Error(ErrorKind::Input, source + ": nested too deeply", remedy);
  } catch (const nlohmann::json::exception& error) {
    const std::string_view cause = error.what();  // begins with "[json.exception...] "
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: not JSON: {}", source, foreign_text(cause.substr(cause.find("] ") + 2))),
        remedy);
  }
}

std::string foreign_text(std::string_view text) {
  return shortened(escaped(text), kMostTextBytes);
}

}  // namespace lenticule::optics
