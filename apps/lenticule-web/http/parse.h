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

namespace lenticule::web {

/// Returns the value of the first cookie of that name in a Cookie header; none if there is none.
[[nodiscard]] std::optional<std::string_view> cookie_value(std::string_view header,
                                                           std::string_view name);

/// Returns the credential of an Authorization header of the scheme Bearer.
[[nodiscard]] std::optional<std::string_view> bearer_credential(std::string_view header);

/// ByteRange is the part of a file that a request carries; `last` is inclusive.
struct ByteRange {
  uint64_t first = 0;
  uint64_t last = 0;
  uint64_t total = 0;

  [[nodiscard]] uint64_t bytes() const { return last - first + 1; }
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

/// Parses a Content-Range header "bytes FIRST-LAST/TOTAL" with FIRST <= LAST < TOTAL.
[[nodiscard]] std::optional<ByteRange> parse_content_range(std::string_view header);

inline constexpr size_t kMaxMediaName = 120;

/// Returns true if `name` may name a file of the media folder: one path component of printable
/// UTF-8 with at most kMaxMediaName bytes that does not begin with a dot, a minus or a blank, does
/// not end with a blank, and contains none of / \ % | < > " ' & : * ?
[[nodiscard]] bool is_media_name(std::string_view name);

}  // namespace lenticule::web
