// SPDX-License-Identifier: Apache-2.0
// Reads members of foreign JSON files with checks; every error names the source and the key.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace lenticule::optics {

/// JsonFields reads one JSON object. Values may be plain or wrapped as {"value": x}.
///
/// Lifetime: the JSON document must outlive this object.
class JsonFields {
 public:
  /// Throws Error(Input) unless `object` is a JSON object.
  JsonFields(const nlohmann::json& object, std::string source);

  /// Returns the unwrapped value of a key, or null.
  [[nodiscard]] const nlohmann::json* find(const std::string& key) const;
  /// Returns a finite number.
  [[nodiscard]] double number(const std::string& key) const;
  [[nodiscard]] double number_or(const std::string& key, double otherwise) const;
  /// Returns a whole number from 1 to kMaxPanelPixels.
  [[nodiscard]] int side(const std::string& key) const;
  /// Returns true for true and for numbers other than zero; returns false if the key is missing.
  [[nodiscard]] bool flag(const std::string& key) const;
  [[nodiscard]] std::string text_or(const std::string& key, const std::string& otherwise) const;

  [[noreturn]] void fail(const std::string& key, const std::string& cause) const;
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  const nlohmann::json& object_;
  std::string source_;
};

/// Returns `text` in a form that a rig file accepts: escaped, and not too long.
[[nodiscard]] std::string foreign_text(std::string_view text);

/// Parses JSON. Throws Error(Input) "source: cause" for invalid JSON.
[[nodiscard]] nlohmann::json parse_json(std::string_view text, const std::string& source);

}  // namespace lenticule::optics
