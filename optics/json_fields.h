// SPDX-License-Identifier: Apache-2.0
// Reads members of JSON files with checks; every error names the source and the key.
#pragma once

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule::optics {

/// JsonFields reads one JSON object. Values may be plain or wrapped as {"value": x}; null is the
/// same as a missing key. All functions throw Error(Input) "source: key: cause".
///
/// Lifetime: the JSON document must outlive this object.
class JsonFields {
 public:
  /// Takes the hint of all errors. Throws Error(Input) unless `object` is a JSON object.
  JsonFields(const nlohmann::json& object, std::string source, std::string remedy = {});

  /// Returns the unwrapped value of a key, or null.
  [[nodiscard]] const nlohmann::json* find(const std::string& key) const;
  [[nodiscard]] const nlohmann::json& need(const std::string& key) const;
  /// Returns a finite number within the limits.
  [[nodiscard]] double number(const std::string& key, double least = kLowest,
                              double most = kHighest) const;
  [[nodiscard]] double number_or(const std::string& key, double otherwise, double least = kLowest,
                                 double most = kHighest) const;
  /// Returns a whole number from 1 to `most`.
  [[nodiscard]] int count(const std::string& key, int most) const;
  /// Returns a whole number from 0 to `most`: the key's, or the one at `value`.
  [[nodiscard]] uint64_t whole(const std::string& key, uint64_t most,
                               const nlohmann::json* value = nullptr) const;
  /// Returns true for true and for numbers other than zero; returns false if the key is missing.
  [[nodiscard]] bool flag(const std::string& key) const;
  [[nodiscard]] std::string text(const std::string& key) const;
  [[nodiscard]] std::string text_or(const std::string& key, const std::string& otherwise) const;
  [[nodiscard]] std::vector<std::string> texts(const std::string& key) const;

  [[noreturn]] void fail(const std::string& key, const std::string& cause) const;
  [[nodiscard]] const std::string& source() const { return source_; }

 private:
  static constexpr double kHighest = std::numeric_limits<double>::max(), kLowest = -kHighest;

  const nlohmann::json& object_;
  std::string source_;
  std::string remedy_;
};

/// Returns `text` in a form that a rig file accepts: escaped, and not too long.
[[nodiscard]] std::string foreign_text(std::string_view text);

/// Parses JSON. Throws Error(Input) "source: cause" for invalid JSON, and for JSON that is nested
/// more deeply than any file that is read.
[[nodiscard]] nlohmann::json parse_json(
    std::string_view text, const std::string& source,
    const std::string& remedy = "correct it, or name another file");

}  // namespace lenticule::optics
