// SPDX-License-Identifier: Apache-2.0
// Reads the declared commands, so that the manual and the completion scripts are generated from the
// same tables as --help.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lenticule::cli {

/// Returns the direct subcommands that --help shows, in its order.
[[nodiscard]] std::vector<const CLI::App*> visible_commands(const CLI::App& app);
[[nodiscard]] std::vector<std::string> command_names(const CLI::App& app);

/// Returns the options that have a flag, in the order of declaration, without positionals.
[[nodiscard]] std::vector<const CLI::Option*> flags(const CLI::App& app);
[[nodiscard]] std::vector<const CLI::Option*> positionals(const CLI::App& app);

/// Returns the words that may follow the command's name: its subcommands, its flags and theirs.
[[nodiscard]] std::vector<std::string> completion_words(const CLI::App& command);

}  // namespace lenticule::cli
