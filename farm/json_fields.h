// SPDX-License-Identifier: Apache-2.0
// JsonFields reads the members of a JSON object from a file, with checks.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace lenticule::farm {

/// Parses JSON that is not deep. Throws Error(Input) "source: cause".
[[nodiscard]] nlohmann::json parse_json(std::string_view text, const std::string& source);

/// All functions throw Error(Input) "source: key: cause" for a missing key and another type or
/// range.
///
/// Lifetime: must not outlive the object.
class JsonFields {
 public:
  JsonFields(const nlohmann::json& object, std::string source);

  [[nodiscard]] const nlohmann::json& need(const char* key) const;
  [[nodiscard]] std::string text(const char* key) const;
  [[nodiscard]] uint64_t whole(const char* key, uint64_t most) const;
  [[nodiscard]] double number(const char* key) const;  ///< at least 0
  [[nodiscard]] std::vector<std::string> texts(const char* key) const;
  [[noreturn]] void fail(const char* key, const std::string& cause) const;

 private:
  const nlohmann::json& object_;
  std::string source_;
};

}  // namespace lenticule::farm
