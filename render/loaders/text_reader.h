// SPDX-License-Identifier: Apache-2.0
// TextReader reads words and numbers of a text file and tracks line numbers; '#' starts a comment.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "optics/vec.h"

namespace lenticule::render {

/// TextReader parses text. All failures are Error(Input) "source:line: reason". Lifetime: the text
/// must outlive the reader.
class TextReader {
 public:
  TextReader(std::string_view text, std::string source);

  /// Returns the next word, on this line or a later one; nothing at the end.
  [[nodiscard]] std::optional<std::string_view> word();
  /// Returns a finite number; `what` names it in error messages.
  [[nodiscard]] double number(const char* what);
  [[nodiscard]] double number_in(const char* what, double low, double high);
  [[nodiscard]] int integer_in(const char* what, int low, int high);
  /// Returns three numbers, each within the coordinate limit.
  [[nodiscard]] Vec3 point(const char* what);
  /// Returns three non-negative numbers.
  [[nodiscard]] Vec3 colour(const char* what);

  /// Returns true if the next word can only be a number.
  [[nodiscard]] bool number_follows();
  /// Returns true if only space and comments are left.
  [[nodiscard]] bool at_end();
  /// Returns true if another word follows on the line of the last word.
  [[nodiscard]] bool more_on_line();

  /// Returns the line of the last word.
  [[nodiscard]] int line() const { return line_; }
  [[nodiscard]] const std::string& source() const { return source_; }
  [[noreturn]] void fail(const std::string& reason) const;
  [[noreturn]] void fail_at(int line, const std::string& reason) const;

 private:
  [[nodiscard]] bool ends_line(size_t position) const;
  void skip_space();

  std::string_view text_;
  std::string source_;
  size_t position_ = 0;
  int scan_line_ = 1;  ///< line of position_
  int line_ = 1;
};

/// Shortens a word from a file and makes it printable, for error messages.
[[nodiscard]] std::string quoted(std::string_view word);

}  // namespace lenticule::render
