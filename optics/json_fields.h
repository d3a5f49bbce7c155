// SPDX-License-Identifier: Apache-2.0
// Reads members of JSON files with checks; every error names the source and the key.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/text.h"

namespace lenticule::optics {

/// JsonFields reads one JSON object. Values may be plain or wrapped as {"value": x}; null is the
/// same as a missing key. All functions throw Error(Input) "source: key: cause".
///
/// Lifetime: the JSON document must outlive this object.
class JsonFields {
 public:
  /// Takes the hint of all errors. Throws Error(Input) unless `object` is a JSON object.
  JsonFields(const nlohmann::json& object, std::string source, std::string remedy = {})
      : object_(object), source_(std::move(source)), remedy_(std::move(remedy)) {
    if (!object.is_object()) throw input_error("{}: not a JSON object", source_).remedy(remedy_);
  }

  /// Returns the unwrapped value of a key, or null.
  [[nodiscard]] const nlohmann::json* find(const std::string& key) const {
    const auto it = object_.find(key);
    if (it == object_.end() || it->is_null()) return nullptr;
    if (!it->is_object()) return &*it;
    const auto wrapped = it->find("value");
    return wrapped != it->end() ? &*wrapped : &*it;
  }
  [[nodiscard]] const nlohmann::json& need(const std::string& key) const {
    const nlohmann::json* value = find(key);
    if (value == nullptr) fail(key, "missing");
    return *value;
  }
  /// Returns a finite number within the limits.
  [[nodiscard]] double number(const std::string& key, double least = kLowest,
                              double most = kHighest) const {
    const nlohmann::json& value = need(key);
    if (!value.is_number()) fail(key, "not a number");
    const double number = value.get<double>();
    if (!std::isfinite(number)) fail(key, "not finite");
    if (!(number >= least && number <= most))
      fail(key, fmt::format("not in {} to {}", least, most));
    return number;
  }
  [[nodiscard]] double number_or(const std::string& key, double otherwise, double least = kLowest,
                                 double most = kHighest) const {
    return find(key) != nullptr ? number(key, least, most) : otherwise;
  }
  /// Returns a whole number from 1 to `most`.
  [[nodiscard]] int count(const std::string& key, int most) const {
    const double value = number(key);
    if (!(value >= 1.0 && value <= most && value == std::floor(value)))
      fail(key, fmt::format("not a whole number of 1 to {}", most));
    return static_cast<int>(value);
  }
  /// Returns a whole number from 0 to `most`: the key's, or the one at `value`.
  [[nodiscard]] uint64_t whole(const std::string& key, uint64_t most,
                               const nlohmann::json* value = nullptr) const {
    if (value == nullptr) value = &need(key);
    if (!value->is_number_unsigned() || value->get<uint64_t>() > most)
      fail(key, fmt::format("not a whole number of 0 to {}", most));
    return value->get<uint64_t>();
  }
  /// Returns a list of such numbers.
  [[nodiscard]] std::vector<uint64_t> wholes(const std::string& key, uint64_t most) const {
    const nlohmann::json& list = need(key);
    if (!list.is_array()) fail(key, "not a list");
    std::vector<uint64_t> numbers;
    for (const nlohmann::json& value : list) numbers.push_back(whole(key, most, &value));
    return numbers;
  }
  /// Returns true for true and for numbers other than zero; returns false if the key is missing.
  [[nodiscard]] bool flag(const std::string& key) const {
    const nlohmann::json* value = find(key);
    if (value == nullptr) return false;
    return value->is_boolean() ? value->get<bool>() : number(key) != 0.0;
  }
  [[nodiscard]] std::string text(const std::string& key) const {
    const nlohmann::json& value = need(key);
    if (!value.is_string()) fail(key, "not a string");
    return value.get<std::string>();
  }
  [[nodiscard]] std::string text_or(const std::string& key, const std::string& otherwise) const {
    return find(key) != nullptr ? text(key) : otherwise;
  }
  [[nodiscard]] std::vector<std::string> texts(const std::string& key) const {
    const nlohmann::json& value = need(key);
    const auto is_text = [](const nlohmann::json& item) { return item.is_string(); };
    if (!value.is_array() || !std::all_of(value.begin(), value.end(), is_text))
      fail(key, "not a list of strings");
    return value.get<std::vector<std::string>>();
  }

  [[noreturn]] void fail(const std::string& key, const std::string& cause) const {
    throw input_error("{}: {}: {}", source_, key, cause).remedy(remedy_);
  }
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  static constexpr double kHighest = std::numeric_limits<double>::max(), kLowest = -kHighest;

  const nlohmann::json& object_;
  std::string source_;
  std::string remedy_;
};

inline constexpr size_t kMostTextBytes = 1024;

/// Returns `text` in a form that a rig file accepts: escaped, and not too long.
[[nodiscard]] inline std::string foreign_text(std::string_view text) {
  return shortened(escaped(text), kMostTextBytes);
}

/// Parses JSON. Throws Error(Input) "source: cause" for invalid JSON, and for JSON that is nested
/// more deeply than any file that is read.
[[nodiscard]] inline nlohmann::json parse_json(
    std::string_view text, const std::string& source,
    const std::string& remedy = "correct it, or name another file") {
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
    throw input_error("{}: nested too deeply", source).remedy(remedy);
  } catch (const nlohmann::json::exception& error) {
    const std::string_view cause = error.what();  // begins with "[json.exception...] "
    throw input_error("{}: not JSON: {}", source, foreign_text(cause.substr(cause.find("] ") + 2)))
        .remedy(remedy);
  }
}

}  // namespace lenticule::optics
