// SPDX-License-Identifier: Apache-2.0
// Reads the declared commands and explains their options, so that the manual and the completion
// scripts are generated from the same tables as --help. The description of an option is one line
// for --help, which may be followed by a line break and a longer text for the manual.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace CLI {
class App;
class FormatterBase;
class Option;
}  // namespace CLI

namespace lenticule::cli {

/// Returns the direct subcommands that --help shows, in its order.
[[nodiscard]] std::vector<const CLI::App*> visible_commands(const CLI::App& app);
[[nodiscard]] std::vector<std::string> command_names(const CLI::App& app);

/// Returns the options that have a flag, in the order of declaration, without positionals.
[[nodiscard]] std::vector<const CLI::Option*> flags(const CLI::App& app);
[[nodiscard]] std::vector<const CLI::Option*> positionals(const CLI::App& app);

/// Returns true if a value follows the option.
[[nodiscard]] bool takes_value(const CLI::Option& option);

/// ValueType describes what an option takes.
struct ValueType {
  std::string name{};    ///< "N", "real|simulated"
  std::string words{};   ///< the words that are accepted, "real,simulated"; empty: any
  std::string range{};   ///< "2 to 4096"
  std::string limits{};  ///< "from 2 to 4096", "above 0"
  bool whole = false;    ///< a whole number
};
[[nodiscard]] ValueType value_type(const CLI::Option& option);

/// Returns the option as it is typed: "--slots N", "--clock real|simulated", "--json", "SCENE".
[[nodiscard]] std::string typed_form(const CLI::Option& option);

/// Returns what --help or the manual says about an option: its description without or with the
/// longer text, then "[required]", its limits and its default: "[2 to 4096; default: 8]".
enum class HelpLength { Short, Long };
[[nodiscard]] std::string explanation(const CLI::Option& option, HelpLength length);

/// Returns the formatter of --help, which breaks lines at 100 columns.
[[nodiscard]] std::shared_ptr<CLI::FormatterBase> make_help_formatter();

}  // namespace lenticule::cli
