// SPDX-License-Identifier: Apache-2.0
// Parses the parts of a request that the HTTP library leaves as text: cookies, credentials, ranges,
// names of files and addresses to listen on. All input comes from strangers.
//
// Thread safety: any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/numbers.h"
#include "base/text.h"

namespace lenticule::web {

/// ByteRange is the part of a file that a request carries; `last` is inclusive.
struct ByteRange {
  uint64_t first = 0;
  uint64_t last = 0;
  uint64_t total = 0;

  [[nodiscard]] uint64_t bytes() const { return last - first + 1; }
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

inline constexpr size_t kMaxMediaName = 120;

inline std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

/// Returns the value of the first cookie of that name in a Cookie header; none if there is none.
[[nodiscard]] inline std::optional<std::string_view> cookie_value(std::string_view header,
                                                                  std::string_view name) {
  while (!header.empty()) {
    std::string_view pair = without_blanks(take_until(header, ';'));
    const size_t equals = pair.find('=');
    if (equals != std::string_view::npos && pair.substr(0, equals) == name)
      return pair.substr(equals + 1);
  }
  return std::nullopt;
}

/// Returns the credential of an Authorization header of the scheme Bearer.
[[nodiscard]] inline std::optional<std::string_view> bearer_credential(std::string_view header) {
  const std::string_view scheme = take_until(header, ' ');
  if (lower_case(std::string(scheme)) != "bearer") return std::nullopt;
  const std::string_view credential = without_blanks(header);
  if (credential.empty()) return std::nullopt;
  return credential;
}

/// Parses a Content-Range header "bytes FIRST-LAST/TOTAL" with FIRST <= LAST < TOTAL.
[[nodiscard]] inline std::optional<ByteRange> parse_content_range(std::string_view header) {
  std::string_view text = without_blanks(header);
  if (lower_case(std::string(take_until(text, ' '))) != "bytes") return std::nullopt;
  const auto first = take_number<uint64_t>(text);
  if (!first || !text.starts_with('-')) return std::nullopt;
  text.remove_prefix(1);
  const auto last = take_number<uint64_t>(text);
  if (!last || !text.starts_with('/')) return std::nullopt;
  text.remove_prefix(1);
  const auto total = number_from<uint64_t>(text);
  if (!total || *first > *last || *last >= *total) return std::nullopt;
  return ByteRange{.first = *first, .last = *last, .total = *total};
}

/// Returns true if `name` may name a file of the media folder: one path component of printable
/// UTF-8 with at most kMaxMediaName bytes that does not begin with a dot, a minus or a blank, does
/// not end with a blank, and contains none of / \ % | < > " ' & : * ?
[[nodiscard]] inline bool is_media_name(std::string_view name) {
  if (name.empty() || name.size() > kMaxMediaName) return false;
  if (name.front() == '.' || name.front() == '-' || name.front() == ' ' || name.back() == ' ')
    return false;
  if (name.find_first_of("/\\%|<>\"'&:*?") != std::string_view::npos) return false;
  return escaped(name) == name;
}

}  // namespace lenticule::web
