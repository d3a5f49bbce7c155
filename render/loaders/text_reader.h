// SPDX-License-Identifier: Apache-2.0
// TextReader reads words and numbers of a text file and tracks line numbers; '#' starts a comment,
// and a backslash at the end of a line joins it with the next one.
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "optics/vec.h"

namespace lenticule::render {

/// TextReader parses text. All failures are Error(Input) "source:line: reason". Lifetime: the text
/// must outlive the reader.
class TextReader {
 public:
  /// `remedy` is the hint of all errors without one of their own.
  TextReader(std::string_view text, std::string source, std::string remedy = {});

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

  /// Returns what is left of the line of the last word, without space around it; a '#' is part of
  /// it.
  [[nodiscard]] std::string_view rest_of_line();
  /// Goes to the end of the line of the last word.
  void skip_line() {
    while (more_on_line()) static_cast<void>(word());
  }

  /// Returns the line of the last word.
  [[nodiscard]] int line() const { return line_; }
  [[noreturn]] void fail(const std::string& reason, const std::string& hint = {}) const;
  [[noreturn]] void fail_at(int line, const std::string& reason,
                            const std::string& hint = {}) const;
  /// Throws Error(Input) if there are more than `most` of something.
  void require_at_most(size_t count, size_t most, const char* what) const;

 private:
  [[nodiscard]] Vec3 vector_in(const char* what, double low, double high);
  [[nodiscard]] bool ends_line(size_t position) const;
  [[nodiscard]] bool is_continued(size_t position) const;
  void skip_space();

  std::string_view text_;
  std::string source_;
  std::string remedy_;
  size_t position_ = 0;
  int scan_line_ = 1;  ///< line of position_
  int line_ = 1;
};

/// Throws Error(Input) "source: reason".
[[noreturn]] void refuse(const std::string& source, const std::string& reason);

/// Returns the number that lies there in the order of bytes of the machine, at any address.
template <class T>
[[nodiscard]] T number_at(const void* from) {
  T number{};
  std::memcpy(&number, from, sizeof number);
  return number;
}

/// Returns the bytes of a file as text. Lifetime: must not outlive the bytes.
[[nodiscard]] inline std::string_view text_of(std::span<const uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Returns the finite number that the whole word is, or nothing. Independent of the locale.
[[nodiscard]] std::optional<double> parse_number(std::string_view word);

/// Returns true if a list with a space before and after each word has the word.
[[nodiscard]] bool is_one_of(std::string_view list, std::string_view word);

/// Shortens a word from a file and makes it printable, for error messages.
[[nodiscard]] std::string quoted(std::string_view word);

}  // namespace lenticule::render
