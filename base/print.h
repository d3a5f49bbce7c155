// SPDX-License-Identifier: Apache-2.0
// The functions in this header print all output of the programs: diagnostics on standard error,
// results on standard output. No other code prints. Text arguments may come from files, devices and
// peers, so they are printed escaped (base/text.h); only the format string itself may contain line
// ends and control sequences.
//
// Thread safety: any thread.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <type_traits>

#include "base/text.h"

namespace lenticule {

/// Verbatim marks text that is printed without escaping: our own text, or text built from escaped
/// parts.
struct Verbatim {
  std::string_view text;
};

namespace print_detail {

/// Returns the value to print for an argument.
template <class T>
[[nodiscard]] auto printed(const T& argument) {
  if constexpr (std::is_same_v<T, Verbatim>) {
    return argument.text;
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    return escaped(argument.native());
  } else if constexpr (std::is_same_v<T, char>) {
    return escaped(std::string_view(&argument, 1));
  } else if constexpr (std::is_convertible_v<const T&, std::string_view>) {
    return escaped(argument);
  } else {
    static_assert(std::is_arithmetic_v<T>, "only numbers, strings and paths can be printed");
    return argument;
  }
}

template <class T>
using Printed = decltype(printed(std::declval<const T&>()));

void format_diagnostic(fmt::string_view format, fmt::format_args arguments);
void format_result(fmt::string_view format, fmt::format_args arguments);
void count_dropped_line() noexcept;

}  // namespace print_detail

/// Prints to standard error. Never throws, and blocks for a quarter of a second at most. Output
/// that cannot be written (a full disk, a reader that has exited or does not read) is dropped and
/// counted.
template <class... Arguments>
void say(fmt::format_string<print_detail::Printed<Arguments>...> format,
         const Arguments&... arguments) noexcept {
  try {
    [format](const auto&... values) {
      print_detail::format_diagnostic(format, fmt::make_format_args(values...));
    }(print_detail::printed(arguments)...);
  } catch (...) {
    print_detail::count_dropped_line();
  }
}

/// Returns the number of lines that say() has dropped since the program started.
[[nodiscard]] uint64_t dropped_log_lines() noexcept;

/// Prints a result to standard output. Throws Error(Failed) when the result cannot be written.
template <class... Arguments>
void print_out(fmt::format_string<print_detail::Printed<Arguments>...> format,
               const Arguments&... arguments) {
  [format](const auto&... values) {
    print_detail::format_result(format, fmt::make_format_args(values...));
  }(print_detail::printed(arguments)...);
}

/// Flushes printed results to the operating system. Throws Error(Failed) when the results cannot be
/// written.
void flush_results();

/// Flushes as flush_results() does, then closes a copy of the descriptor, because some file systems
/// report failed writes only at close(). Call it at the end of a program.
void finish_results();

/// Prepares the standard input, output and error of a program: opens /dev/null on each of their
/// descriptors that is closed, since the next opened file would get that number otherwise, and
/// ignores SIGPIPE. Printing a result to a closed standard output is an error, like printing to a
/// full disk. Call it first in main().
void prepare_standard_streams() noexcept;

}  // namespace lenticule
