// SPDX-License-Identifier: Apache-2.0
#include "optics/json_fields.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/text.h"
#include "optics/rig.h"

namespace lenticule::optics {
namespace {

constexpr size_t kMostTextBytes = 1024;

}  // namespace

JsonFields::JsonFields(const nlohmann::json& object, std::string source)
    : object_(object), source_(std::move(source)) {
  if (!object.is_object()) throw Error(ErrorKind::Input, source_ + ": not a JSON object");
}

const nlohmann::json* JsonFields::find(const std::string& key) const {
  const auto it = object_.find(key);
  if (it == object_.end()) return nullptr;
  if (!it->is_object()) return &*it;
  const auto wrapped = it->find("value");
  return wrapped != it->end() ? &*wrapped : &*it;
}

double JsonFields::number(const std::string& key) const {
  const nlohmann::json* value = find(key);
  if (value == nullptr) fail(key, "missing");
  if (!value->is_number()) fail(key, "not a number");
  const double number = value->get<double>();
  if (!std::isfinite(number)) fail(key, "not finite");
  return number;
}

double JsonFields::number_or(const std::string& key, double otherwise) const {
  return find(key) != nullptr ? number(key) : otherwise;
}

int JsonFields::side(const std::string& key) const {
  const double value = number(key);
  if (!(value >= 1.0 && value <= kMaxPanelPixels && value == std::floor(value))) {
    fail(key, fmt::format("not a whole number of 1 to {}", kMaxPanelPixels));
  }
  return static_cast<int>(value);
}

bool JsonFields::flag(const std::string& key) const {
  const nlohmann::json* value = find(key);
  if (value == nullptr) return false;
  return value->is_boolean() ? value->get<bool>() : number(key) != 0.0;
}

std::string JsonFields::text_or(const std::string& key, const std::string& otherwise) const {
  const nlohmann::json* value = find(key);
  if (value == nullptr) return otherwise;
  if (!value->is_string()) fail(key, "not a string");
  return value->get<std::string>();
}

void JsonFields::fail(const std::string& key, const std::string& cause) const {
  throw Error(ErrorKind::Input, fmt::format("{}: {}: {}", source_, key, cause));
}

nlohmann::json parse_json(std::string_view text, const std::string& source) {
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    const std::string_view cause = error.what();  // begins with "[json.exception...] "
    throw Error(
        ErrorKind::Input,
        fmt::format("{}: not JSON: {}", source, foreign_text(cause.substr(cause.find("] ") + 2))),
        "correct it, or name another file");
  }
}

std::string foreign_text(std::string_view text) {
  return shortened(escaped(text), kMostTextBytes);
}

}  // namespace lenticule::optics
