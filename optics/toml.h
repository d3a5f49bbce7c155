// SPDX-License-Identifier: Apache-2.0
// Reads and writes TOML for all our files: parse_toml(), TomlSection for a table whose members are
// checked, and the texts of values. Include only from .cpp files that use toml++.
#pragma once

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error_kinds.h"
#include "base/text.h"

namespace lenticule::optics {

/// Returns the line, counted from 1, of the first character outside ASCII that is in neither a
/// string nor a comment; TOML does not allow such a character.
[[nodiscard]] std::optional<int> stray_letter_line(std::string_view text);

/// Parses TOML. Throws Error(Input) "source:line: cause". Keys are ASCII; strings and comments may
/// hold all characters that TOML allows.
[[nodiscard]] toml::table parse_toml(std::string_view text, const std::string& source);

/// TomlSection is one table of the file: it reads members by key and reports errors with
/// "source:line:".
class TomlSection {
 public:
  TomlSection(const toml::table& table, std::string name, const std::string& source)
      : table_(table), name_(std::move(name)), source_(source) {}

  [[noreturn]] void fail(const toml::node& at, const std::string& cause,
                         const std::string& remedy = {}) const {
    fail(at.source().begin.line, cause, remedy);
  }

  /// Throws for a key that is not in the list, and names the most similar key of the list.
  void allow_only(std::initializer_list<std::string_view> known) const {
    for (const auto& [key, value] : table_) {
      const std::string_view word = key.str();
      if (std::find(known.begin(), known.end(), word) != known.end()) continue;
      const auto nearest = nearest_word(word, {known.begin(), known.size()});
      fail(key.source().begin.line, fmt::format("unknown key '{}'", full_name(clipped(word))),
           nearest ? fmt::format("did you mean '{}'?", *nearest)
                   : fmt::format("known here: {}", fmt::join(known, ", ")));
    }
  }

  [[nodiscard]] const toml::node* find(std::string_view key) const { return table_.get(key); }

  [[nodiscard]] const toml::node& get(std::string_view key) const {
    if (const toml::node* node = find(key)) return *node;
    fail(table_.source().begin.line, fmt::format("key '{}' is missing", full_name(key)));
  }

  [[nodiscard]] double number(std::string_view key) const { return number_of(get(key), key); }
  [[nodiscard]] double number_or(std::string_view key, double otherwise) const {
    return find(key) != nullptr ? number(key) : otherwise;
  }

  [[nodiscard]] double number_of(const toml::node& node, std::string_view key) const {
    if (const auto* real = node.as_floating_point()) return real->get();
    if (const auto* whole = node.as_integer()) return static_cast<double>(whole->get());
    fail(node, fmt::format("'{}' is not a number", full_name(key)));
  }

  /// Reads a number within limits; NaN is outside.
  [[nodiscard]] double number_within(std::string_view key, double low, double high) const {
    const double value = number(key);
    require_within(get(key), value, key, low, high);
    return value;
  }
  void require_within(const toml::node& at, double value, std::string_view key, double low,
                      double high) const {
    if (value >= low && value <= high) return;
    fail(at, fmt::format("'{}' is {}, not within {} to {}", full_name(key), value, low, high));
  }

  /// Reads a whole number of a plausible size; the validator checks the exact limits.
  [[nodiscard]] int whole(std::string_view key) const {
    return static_cast<int>(whole_within(key, -1'000'000, 1'000'000));
  }

  [[nodiscard]] int64_t whole_within(std::string_view key, int64_t low, int64_t high) const {
    const toml::node& node = get(key);
    const auto* value = node.as_integer();
    if (value == nullptr) fail(node, fmt::format("'{}' is not a whole number", full_name(key)));
    if (value->get() < low || value->get() > high)
      fail(node, fmt::format("'{}' is not within {} to {}", full_name(key), low, high));
    return value->get();
  }

  [[nodiscard]] std::string text_or(std::string_view key, const std::string& otherwise) const {
    const toml::node* node = find(key);
    return node != nullptr ? text_of(*node, key) : otherwise;
  }

  [[nodiscard]] std::string text_of(const toml::node& node, std::string_view key) const {
    if (const auto* text = node.as_string()) return text->get();
    fail(node, fmt::format("'{}' is not a string in quotes", full_name(key)));
  }

  [[nodiscard]] const toml::array& array(std::string_view key) const {
    const toml::node& node = get(key);
    if (const toml::array* list = node.as_array()) return *list;
    fail(node, fmt::format("'{}' is not a list in [ ]", full_name(key)));
  }

  [[nodiscard]] std::vector<double> numbers(const toml::array& list, std::string_view key) const {
    std::vector<double> out;
    out.reserve(list.size());
    for (const toml::node& item : list) out.push_back(number_of(item, key));
    return out;
  }

  [[nodiscard]] TomlSection section(std::string_view key) const {
    const toml::node& node = get(key);
    if (const toml::table* table = node.as_table()) return {*table, full_name(key), source_};
    fail(node, fmt::format("'{}' is not a section", full_name(key)));
  }

  /// Checks the key "format" of a file's root table.
  void require_format_1() const {
    if (whole_within("format", 0, std::numeric_limits<int64_t>::max()) != 1)
      fail(get("format"), "unknown format; expected 1",
           "it was made by a newer version of this program");
  }

  [[nodiscard]] std::string full_name(std::string_view key) const {
    return name_.empty() ? std::string(key) : fmt::format("{}.{}", name_, key);
  }

  [[nodiscard]] const toml::table& table() const { return table_; }

 private:
  [[noreturn]] void fail(toml::source_index line, const std::string& cause,
                         const std::string& remedy) const {
    throw input_error("{}:{}: {}", source_, std::max(line, 1u), cause).remedy(remedy);
  }
  [[noreturn]] void fail(toml::source_index line, const std::string& cause) const {
    fail(line, cause, {});
  }

  static std::string_view clipped(std::string_view word) { return word.substr(0, 64); }

  const toml::table& table_;
  std::string name_;
  const std::string& source_;
};

/// Returns a floating-point number with the fewest digits that read back as the same bits.
[[nodiscard]] std::string toml_number(double value);

/// Returns a string in quotes.
[[nodiscard]] std::string toml_string(std::string_view text);

}  // namespace lenticule::optics
