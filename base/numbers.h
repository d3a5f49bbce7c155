// SPDX-License-Identifier: Apache-2.0
// Parses numbers in texts from files, names and command lines: digits in ASCII, independent of the
// locale, without blanks, "+", infinity and NaN. A minus is accepted where the type has a sign.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>
#include <system_error>
#include <type_traits>

namespace lenticule {

/// Removes the number at the start of `text` and returns it; returns none, and leaves `text`
/// unchanged, if there is none or it does not fit into the type. `format` is the base of a whole
/// number or the std::chars_format of a decimal number.
template <class Number, class... Format>
[[nodiscard]] std::optional<Number> take_number(std::string_view& text, Format... format) {
  Number value{};
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), value, format...);
  if (error != std::errc()) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>)
    if (!std::isfinite(value)) return std::nullopt;
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return value;
}

/// Returns the number that the whole text is.
template <class Number, class... Format>
[[nodiscard]] std::optional<Number> number_from(std::string_view text, Format... format) {
  const auto value = take_number<Number>(text, format...);
  return text.empty() ? value : std::nullopt;
}

/// Returns the numbers of "1920x1080" (separator x) or "0,1.5,-2" (separator ,).
template <class Number, size_t kCount>
[[nodiscard]] std::optional<std::array<Number, kCount>> numbers_from(std::string_view text,
                                                                     char separator) {
  std::array<Number, kCount> numbers{};
  for (size_t i = 0; i < kCount; ++i) {
    if (i > 0) {
      if (!text.starts_with(separator)) return std::nullopt;
      text.remove_prefix(1);
    }
    const auto number = take_number<Number>(text);
    if (!number) return std::nullopt;
    numbers[i] = *number;
  }
  return text.empty() ? std::optional(numbers) : std::nullopt;
}

/// Removes the text before the first `separator`, and the separator, and returns the text; without
/// a separator, this is all of it.
[[nodiscard]] inline std::string_view take_until(std::string_view& text, char separator) {
  const size_t end = text.find(separator);
  const std::string_view head = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return head;
}

}  // namespace lenticule
