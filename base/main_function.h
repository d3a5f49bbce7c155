// SPDX-License-Identifier: Apache-2.0
// The parts that the main functions of the programs share.
#pragma once

#include <functional>
#include <optional>
#include <sstream>
#include <string>

#include "base/error.h"
#include "base/exit_code.h"
#include "base/print.h"

namespace lenticule {

/// ErrorStyle is how a program reports errors on standard error: one line of text "PROGRAM: error"
/// and one with the remedy, or one line of JSON {"error", "hint", "kind", "exit_code"}.
struct ErrorStyle {
  const char* program;
  bool as_json = false;
  const char* memory_hint = "";  ///< remedy when the memory is used up
};

/// Reports the error and returns its exit code.
[[nodiscard]] int report_error(const Error& error, const ErrorStyle& style) noexcept;

/// Calls `run` and flushes the printed results. Returns the exit code of `run`, or that of a
/// reported exception.
[[nodiscard]] int run_reporting_errors(const std::function<int()>& run, const ErrorStyle& style);

/// Calls prepare_standard_streams() and best_isa(). Returns an exit code other than kOk if the
/// environment names no instruction set. Call it first in main().
[[nodiscard]] int prepare_program(const ErrorStyle& style);

/// Prints the help or the version that `request` asks for on standard output, because they are
/// results. The types are CLI::App and CLI::ParseError, whose header takes seconds to compile.
template <class App, class Request>
[[nodiscard]] int print_help(const App& app, const Request& request, const ErrorStyle& style) {
  const auto print = [&] {
    std::ostringstream text;
    app.exit(request, text, text);
    print_out("{}", Verbatim{text.view()});
    return kOk;
  };
  return run_reporting_errors(print, style);
}

/// Parses the arguments. Returns the exit code of main() if that is all to be done: after the help,
/// the version or an error. The types are CLI::ParseError and CLI::App.
template <class ParseError, class App>
[[nodiscard]] std::optional<int> parse_arguments(App& app, int argc, char** argv,
                                                 const ErrorStyle& style) {
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const ParseError& error) {
    if (error.get_exit_code() == 0) return print_help(app, error, style);
    return report_error(
        {ErrorKind::Usage, error.what(), std::string("see ") + style.program + " --help"}, style);
  }
}

}  // namespace lenticule
