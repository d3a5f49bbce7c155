// SPDX-License-Identifier: Apache-2.0
#include "calib/report/plain_text.h"

#include <cstdint>

namespace lenticule::calib {
namespace {

bool is_continuation(char c) {
  return (static_cast<unsigned char>(c) & 0xC0U) == 0x80U;
}

/// How many bytes a character has that begins with `lead`; 0 for a byte that begins none.
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

/// Long forms of short codes and halves of pairs are not UTF-8; the controls after ASCII's are
/// UTF-8, but nothing to print.
bool is_wanted(uint32_t code, size_t length) {
  if (length == 1) return code >= 0x20 && code != 0x7F;
  if (length == 2) return code >= 0xA0;
  if (length == 3) return code >= 0x800 && (code < 0xD800 || code > 0xDFFF);
  return code >= 0x10000 && code <= 0x10FFFF;
}

/// The printable character at the start of `text`, empty if there is none.
std::string_view character_at_start(std::string_view text) {
  const size_t length = announced_length(static_cast<unsigned char>(text[0]));
  if (length == 0 || length > text.size()) return {};
  for (size_t i = 1; i < length; ++i)
    if (!is_continuation(text[i])) return {};
  const std::string_view character = text.substr(0, length);
  return is_wanted(code_point(character), length) ? character : std::string_view{};
}

}  // namespace

std::string printable(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const std::string_view character = character_at_start(text);
    if (!character.empty()) {
      out += character;
      text.remove_prefix(character.size());
      continue;
    }
    const char c = text[0];
    out += c == '\t' || c == '\n' || c == '\r' ? ' ' : '?';
    text.remove_prefix(1);
  }
  return out;
}

std::string clipped(std::string text, size_t bytes) {
  constexpr std::string_view kMore = "...";
  if (text.size() <= bytes) return text;
  size_t end = bytes - kMore.size();
  while (end > 0 && is_continuation(text[end])) --end;
  text.resize(end);
  return text += kMore;
}

std::string html_escaped(std::string_view text) {
  std::string out;
  for (const char c : printable(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

}  // namespace lenticule::calib
