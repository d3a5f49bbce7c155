// SPDX-License-Identifier: Apache-2.0
// What the programs print: diagnostics on standard error, results on standard output. Nothing else
// prints. Texts that are arguments may come from files, devices and peers: they are printed
// escaped (base/text.h); only the format itself has line ends and control sequences. Any thread.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <type_traits>

#include "base/text.h"

namespace lenticule {

/// Text that is printed as it is: our own, or put together from escaped parts.
struct Verbatim {
  std::string_view text;
};

namespace print_detail {

/// Returns what is printed for an argument.
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
    static_assert(std::is_arithmetic_v<T>, "numbers, texts and paths are printed");
    return argument;
  }
}

template <class T>
using Printed = decltype(printed(std::declval<const T&>()));

void format_diagnostic(fmt::string_view format, fmt::format_args arguments);
void format_result(fmt::string_view format, fmt::format_args arguments);
void count_dropped_line() noexcept;

}  // namespace print_detail

/// Prints to standard error. Never throws and waits a quarter of a second at most: what cannot be
/// written (a full disk, a reader that is gone or does not read) is dropped and counted.
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

/// The lines that say() could not write since the program started.
[[nodiscard]] uint64_t dropped_log_lines() noexcept;

/// Prints a result to standard output. Throws Error(Failed) when that cannot be written.
template <class... Arguments>
void print_out(fmt::format_string<print_detail::Printed<Arguments>...> format,
               const Arguments&... arguments) {
  [format](const auto&... values) {
    print_detail::format_result(format, fmt::make_format_args(values...));
  }(print_detail::printed(arguments)...);
}

/// Hands printed results to the system. Throws Error(Failed) when they cannot be written.
void flush_results();

/// The same at the end of a program, where file systems that write late report failures too.
void finish_results();

/// Prepares standard input, output and error of a program: fills the numbers of those that are
/// closed, which would go to the next file that is opened, and ignores SIGPIPE. Results for a
/// closed standard output are an error as those for a full disk are. Call it first in main().
void prepare_standard_streams() noexcept;

}  // namespace lenticule
