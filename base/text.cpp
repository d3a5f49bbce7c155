// SPDX-License-Identifier: Apache-2.0
#include "base/text.h"

#include <string.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "base/numbers.h"

namespace lenticule {
namespace {

struct CodeRange {
  uint32_t first;
  uint32_t last;
};

/// Lists the characters that are never printed unescaped. Characters that join letters (U+200C,
/// U+200D) are needed in several languages and are not listed.
constexpr std::array kEscaped = {
    CodeRange{0x00, 0x1F},        // control characters
    CodeRange{0x7F, 0x9F},        // DEL and the second set of control characters
    CodeRange{0xAD, 0xAD},        // soft hyphen: invisible
    CodeRange{0x61C, 0x61C},      // Arabic letter mark
    CodeRange{0x200B, 0x200B},    // zero-width space
    CodeRange{0x200E, 0x200F},    // left-to-right and right-to-left marks
    CodeRange{0x2028, 0x202E},    // line and paragraph ends, direction overrides
    CodeRange{0x2060, 0x206F},    // invisible operators, direction isolates
    CodeRange{0xD800, 0xDFFF},    // halves of pairs
    CodeRange{0xFEFF, 0xFEFF},    // byte order mark
    CodeRange{0xFFF9, 0xFFFB},    // annotation marks
    CodeRange{0xFFFE, 0xFFFF},    // not characters
    CodeRange{0xE0000, 0xE007F},  // tags: invisible
};

bool is_digit(char c) { return c >= '0' && c <= '9'; }

bool is_continuation(char c) { return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U; }

/// Returns the number of bytes of a character that begins with `lead`; 0 if no character begins so.
size_t announced_length(unsigned char lead) {
  if (lead < 0x80) return 1;
  if (lead >= 0xC2 && lead <= 0xDF) return 2;
  if (lead >= 0xE0 && lead <= 0xEF) return 3;
  if (lead >= 0xF0 && lead <= 0xF4) return 4;
  return 0;
}

uint32_t code_point(std::string_view character) {
  const auto lead = static_cast<unsigned char>(character[0]);
  if (character.size() == 1) return lead;
  uint32_t code = lead & (0xFFU >> (character.size() + 1));
  for (const char c : character.substr(1)) code = code << 6 | (static_cast<unsigned char>(c) & 63U);
  return code;
}

/// Returns true for a printable character. An overlong encoding is not valid UTF-8.
bool is_printable(uint32_t code, size_t length) {
  if ((length == 3 && code < 0x800) || (length == 4 && (code < 0x10000 || code > 0x10FFFF)))
    return false;
  return std::none_of(kEscaped.begin(), kEscaped.end(), [code](const CodeRange& range) {
    return code >= range.first && code <= range.last;
  });
}

/// Returns the printable character at the start of `text`; empty if there is none.
std::string_view character_at_start(std::string_view text) {
  const size_t length = announced_length(static_cast<unsigned char>(text[0]));
  if (length == 0 || length > text.size()) return {};
  for (size_t i = 1; i < length; ++i)
    if (!is_continuation(text[i])) return {};
  const std::string_view character = text.substr(0, length);
  return is_printable(code_point(character), length) ? character : std::string_view{};
}

/// Returns the number of edits that turn one word into the other.
size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = std::exchange(row[0], i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

}  // namespace

std::string escaped(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const std::string_view character = character_at_start(text);
    if (!character.empty()) {
      out += character;
      text.remove_prefix(character.size());
      continue;
    }
    const auto byte = static_cast<unsigned char>(text[0]);
    out += {'\\', 'x', kDigits[byte >> 4U], kDigits[byte & 15U]};
    text.remove_prefix(1);
  }
  return out;
}

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

bool NaturalOrder::operator()(std::string_view a, std::string_view b) const {
  // strverscmp() would take numbers with zeros before them for fractions.
  const auto comparable = [](std::string_view name) {
    std::string out;
    for (size_t i = 0; i < name.size(); ++i) {
      const bool begins_number = out.empty() || !is_digit(out.back());
      const bool precedes_digit = i + 1 < name.size() && is_digit(name[i + 1]);
      if (name[i] != '0' || !begins_number || !precedes_digit) out += name[i];
    }
    return lower_case(std::move(out));
  };
  const int order = strverscmp(comparable(a).c_str(), comparable(b).c_str());
  return order != 0 ? order < 0 : a < b;
}

std::string percent_decoded(std::string_view text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const std::string_view digits = text.substr(i + 1, 2);
    const auto code =
        text[i] == '%' && digits.size() == 2 ? number_from<unsigned>(digits, 16) : std::nullopt;
    out += code ? static_cast<char>(*code) : text[i];
    if (code) i += 2;
  }
  return out;
}

std::string shortened(std::string text, size_t bytes) {
  constexpr std::string_view kMore = "...";
  if (text.size() <= bytes) return text;
  size_t end = bytes - kMore.size();
  while (end > 0 && is_continuation(text[end])) --end;
  text.resize(end);
  return text += kMore;
}

std::optional<std::string_view> nearest_word(std::string_view word,
                                             std::span<const std::string_view> known) {
  constexpr size_t kLongest = 64;  // all known words are shorter
  word = word.substr(0, kLongest);
  std::optional<std::string_view> nearest;
  size_t least = std::max<size_t>(1, word.size() / 2);
  for (const std::string_view candidate : known) {
    const size_t distance = edit_distance(candidate, word);
    if (distance > least || (nearest && distance == least)) continue;
    nearest = candidate;
    least = distance;
  }
  return nearest;
}

std::string shell_quoted(std::string_view word) {
  constexpr std::string_view kPlain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-./:,=+@";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string_view::npos)
    return std::string(word);
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace lenticule
