// SPDX-License-Identifier: Apache-2.0
// Makes text from files, devices and peers safe for terminals, logs and JSON.
//
// Thread safety: any thread.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace lenticule {

/// Returns `text` as printable UTF-8 on one line. Replaces each byte of the following by \x and two
/// hexadecimal digits ("\x1b[2J"): control characters (line ends and tabs too), characters that are
/// invisible or change the writing direction, and bytes that are not UTF-8.
[[nodiscard]] std::string escaped(std::string_view text);

/// Returns the text with the letters A to Z in lower case.
[[nodiscard]] std::string lower_case(std::string text);

/// NaturalOrder orders the names of files as people count them: "a2" before "A10". Case, and zeros
/// before a number, matter only between names that are otherwise equal.
struct NaturalOrder {
  [[nodiscard]] bool operator()(std::string_view a, std::string_view b) const;
};

/// Decodes "%20" and similar, as URIs have them.
[[nodiscard]] std::string percent_decoded(std::string_view text);

/// Returns at most `bytes` bytes of `text`; longer text is cut after a whole character and ends in
/// "...". `text` must be UTF-8 and `bytes` at least 3.
[[nodiscard]] std::string shortened(std::string text, size_t bytes);

/// Returns `word` as a POSIX shell reads it back unchanged; in quotes if it has other characters
/// than letters, digits and a few that have no meaning to a shell.
[[nodiscard]] std::string shell_quoted(std::string_view word);

/// Returns the word of `known` that `word` was probably meant to be: the word at the smallest edit
/// distance (insert, delete, replace a letter), if the distance is at most half the length of
/// `word`.
[[nodiscard]] std::optional<std::string_view> nearest_word(std::string_view word,
                                                           std::span<const std::string_view> known);

/// Returns JSON in ASCII, which contains no escape sequence of terminals and is valid for texts of
/// any bytes: invalid UTF-8 becomes U+FFFD. `Json` is nlohmann::json or ordered_json.
template <class Json>
[[nodiscard]] std::string json_text(const Json& value, int indent = -1) {
  return value.dump(indent, ' ', true, Json::error_handler_t::replace);
}

}  // namespace lenticule
