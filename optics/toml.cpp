// SPDX-License-Identifier: Apache-2.0
#include "optics/toml.h"

namespace lenticule::optics {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

/// Scanner divides a text by TOML's grammar: strings of four kinds, comments, and the rest.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {
    if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
  }

  std::optional<int> stray_letter_line() {
    while (at_ < text_.size()) {
      const char letter = text_[at_];
      if (static_cast<unsigned char>(letter) >= 0x80) return line_;
      if (letter == '#')
        at_ = std::min(text_.find('\n', at_), text_.size());
      else if (letter == '"' || letter == '\'')
        skip_quoted(letter);
      else
        step();
    }
    return std::nullopt;
  }

 private:
  void step() {
    if (text_[at_] == '\n') ++line_;
    ++at_;
  }

  /// Skips a string. A string in single quotes has no escapes; a string in three quotes may have
  /// many lines. An unterminated string extends to the end of its line or of the file; the parser
  /// reports the error.
  void skip_quoted(char quote) {
    const std::string three(3, quote);
    const bool long_text = text_.substr(at_).starts_with(three);
    const std::string_view end = std::string_view(three).substr(0, long_text ? 3 : 1);
    at_ += end.size();
    while (at_ < text_.size() && !text_.substr(at_).starts_with(end)) {
      if (text_[at_] == '\n' && !long_text) return;
      if (text_[at_] == '\\' && quote == '"') step();
      if (at_ < text_.size()) step();
    }
    at_ = std::min(at_ + end.size(), text_.size());
    // One or two quotes may precede the three that end a long string.
    for (int n = 0; n < 2 && long_text && at_ < text_.size() && text_[at_] == quote; ++n) ++at_;
  }

  std::string_view text_;
  size_t at_ = 0;
  int line_ = 1;
};

[[noreturn]] void fail(const std::string& source, int line, std::string_view cause,
                       const char* remedy) {
  throw input_error("{}:{}: {}", source, std::max(line, 1), cause).remedy(remedy);
}

}  // namespace

std::optional<int> stray_letter_line(std::string_view text) {
  return Scanner(text).stray_letter_line();
}

toml::table parse_toml(std::string_view text, const std::string& source) {
  // toml++ has undefined behaviour for such a character, so it is refused first.
  if (const std::optional<int> line = stray_letter_line(text))
    fail(source, *line, "a character outside ASCII that is not in quotes",
         "keys and numbers are ASCII; put strings in quotes");
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    fail(source, static_cast<int>(error.source().begin.line), error.description(),
         "correct the line, or name another file");
  }
}

std::string toml_number(double value) {
  std::string text = fmt::format("{}", value);
  const bool looks_whole = text.find_first_not_of("-0123456789") == std::string::npos;
  if (looks_whole) text += ".0";
  return text;
}

std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (c == '\n') {
      out += "\\n";
    } else if (c == '\t') {
      out += "\\t";
    } else {
      out += c;
    }
  }
  return out + '"';
}

}  // namespace lenticule::optics
