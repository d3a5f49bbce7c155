// SPDX-License-Identifier: Apache-2.0
// Words and numbers of a text file with their line numbers; '#' starts a comment.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "optics/vec.h"

namespace lenticule::render {

/// Walks over text that must outlive it. Every failure is Error(Input) "source:line: reason".
class TextReader {
 public:
  TextReader(std::string_view text, std::string source);

  /// The next word, on this line or a later one; nothing at the end.
  [[nodiscard]] std::optional<std::string_view> word();
  /// A finite number; `what` names it in the error.
  [[nodiscard]] double number(const char* what);
  [[nodiscard]] double number_in(const char* what, double low, double high);
  [[nodiscard]] int integer_in(const char* what, int low, int high);
  /// Three numbers, each within the coordinate limit.
  [[nodiscard]] Vec3 point(const char* what);
  /// Three numbers, none negative.
  [[nodiscard]] Vec3 colour(const char* what);

  /// Whether the next word can only be a number.
  [[nodiscard]] bool number_follows();
  /// Whether nothing but space and comments is left.
  [[nodiscard]] bool at_end();
  /// Whether another word stands on the line of the last one.
  [[nodiscard]] bool more_on_line();

  /// Of the last word.
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
  int scan_line_ = 1;  ///< of position_
  int line_ = 1;
};

/// A word from a file made fit for a message: short and printable.
[[nodiscard]] std::string quoted(std::string_view word);

}  // namespace lenticule::render
