// SPDX-License-Identifier: Apache-2.0
// Members of somebody else's JSON file, checked: every failure names the source and the key.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace lenticule::optics {

/// One JSON object. Values may be plain or wrapped as {"value": x}. The document must outlive it.
class JsonFields {
 public:
  /// Throws Error(Input) unless `object` is a JSON object.
  JsonFields(const nlohmann::json& object, std::string source);

  /// The unwrapped value of a key, or null.
  [[nodiscard]] const nlohmann::json* find(const std::string& key) const;
  /// A finite number.
  [[nodiscard]] double number(const std::string& key) const;
  [[nodiscard]] double number_or(const std::string& key, double otherwise) const;
  /// A whole number of 1 to kMaxPanelPixels.
  [[nodiscard]] int side(const std::string& key) const;
  /// true, false or a number that is not zero; false if there is none.
  [[nodiscard]] bool flag(const std::string& key) const;
  [[nodiscard]] std::string text_or(const std::string& key, const std::string& otherwise) const;

  [[noreturn]] void fail(const std::string& key, const std::string& cause) const;
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  const nlohmann::json& object_;
  std::string source_;
};

/// Returns `text` fit for a rig file: escaped and not too long.
[[nodiscard]] std::string foreign_text(std::string_view text);

/// Throws Error(Input) "source: cause" for what is not JSON.
[[nodiscard]] nlohmann::json parse_json(std::string_view text, const std::string& source);

}  // namespace lenticule::optics
