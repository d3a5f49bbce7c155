// SPDX-License-Identifier: Apache-2.0
// Text from files, devices and peers, made fit for terminals, logs and JSON. Any thread.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace lenticule {

/// Returns `text` as printable UTF-8 on one line. Every byte of a control character (line ends and
/// tabs too), of a character that is invisible or turns the direction of writing, and of what is
/// not UTF-8 becomes \x and two hexadecimal digits: "\x1b[2J".
[[nodiscard]] std::string escaped(std::string_view text);

/// Returns at most `bytes` of `text`; what is longer ends in "..." after a whole character. `text`
/// must be UTF-8 and `bytes` 3 at least.
[[nodiscard]] std::string shortened(std::string text, size_t bytes);

/// Returns the word of `known` that `word` may have been meant for: the one that is fewest edits
/// (insert, delete, replace a letter) away, if they are at most half of the word.
[[nodiscard]] std::optional<std::string_view> nearest_word(std::string_view word,
                                                           std::span<const std::string_view> known);

/// Returns JSON in ASCII, which holds no escape sequence and is valid whatever bytes its texts
/// have: what is not UTF-8 becomes U+FFFD. `Json` is nlohmann::json or ordered_json.
template <class Json>
[[nodiscard]] std::string json_text(const Json& value, int indent = -1) {
  return value.dump(indent, ' ', true, Json::error_handler_t::replace);
}

}  // namespace lenticule
