// SPDX-License-Identifier: Apache-2.0
// Explains options in --help and in the manual. The description of an option is one line for
// --help, which may be followed by a line break and a longer text for the manual.
#pragma once

#include <memory>
#include <string>

namespace CLI {
class FormatterBase;
class Option;
}  // namespace CLI

namespace lenticule::cli {

/// Returns the option as it is typed: "--slots N", "--clock real|simulated", "--json", "SCENE".
[[nodiscard]] std::string typed_form(const CLI::Option& option);

/// Returns what --help or the manual says about an option: its description without or with the
/// longer text, then "[required]", its limits and its default: "[2 to 4096; default: 8]".
enum class HelpLength { Short, Long };
[[nodiscard]] std::string explanation(const CLI::Option& option, HelpLength length);

/// Returns the formatter of --help, which breaks lines at 100 columns.
[[nodiscard]] std::shared_ptr<CLI::FormatterBase> make_help_formatter();

}  // namespace lenticule::cli
