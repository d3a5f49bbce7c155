// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/usage_error.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/command_tree.h"
#include "base/text.h"

namespace lenticule::player {
namespace {

/// The chosen commands, from the program down.
using Chain = std::vector<const CLI::App*>;

Chain chosen_commands(const CLI::App& app) {
  Chain chain = {&app};
  while (!chain.back()->get_subcommands().empty())
    chain.push_back(chain.back()->get_subcommands().front());
  return chain;
}

std::string name_of(const Chain& chain) {
  std::string name;
  for (const CLI::App* command : chain) name += (name.empty() ? "" : " ") + command->get_name();
  return name;
}

/// Returns the first word that no command accepted.
std::optional<std::string> unknown_word(const Chain& chain) {
  for (const CLI::App* command : chain)
    for (const std::string& word : command->remaining())
      if (word != "--") return word;
  return std::nullopt;
}

std::vector<std::string> flag_names(const Chain& chain) {
  std::vector<std::string> names;
  for (const CLI::App* command : chain)
    for (const CLI::Option* option : flags(*command))
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

std::string remedy(std::string_view word, const std::vector<std::string>& known,
                   const std::string& name) {
  const std::vector<std::string_view> views(known.begin(), known.end());
  const auto nearest = nearest_word(word, views);
  return nearest ? fmt::format("did you mean '{}'? see {} --help", *nearest, name)
                 : fmt::format("see {} --help", name);
}

// ---- missing flags and arguments

/// Returns the name that a user types.
std::string typed_name(const CLI::Option& option) {
  if (!option.nonpositional()) return option.get_name(true);
  return option.get_snames().empty() ? "--" + option.get_lnames().front()
                                     : "-" + option.get_snames().front();
}

std::vector<const CLI::Option*> missing_options(const CLI::App& command) {
  return command.get_options(
      [](const CLI::Option* option) { return option->get_required() && option->count() == 0; });
}

/// Returns "a", "a and b" or "a, b and c".
std::string listed(const std::vector<std::string>& words) {
  if (words.size() == 1) return words.front();
  return fmt::format("{} and {}", fmt::join(words.begin(), words.end() - 1, ", "), words.back());
}

/// Returns the word that follows `flag` in the example of a command, or an empty one.
std::string example_value(const std::string& command, const std::string& flag) {
  for (const Command& one : commands()) {
    if (command != one.name) continue;
    std::string_view rest = one.example;
    const size_t at = rest.find(" " + flag + " ");
    if (at == std::string_view::npos) break;
    rest.remove_prefix(at + flag.size() + 2);
    return std::string(rest.substr(0, rest.find(' ')));
  }
  return {};
}

/// Returns a value for a missing option, or an empty text if none is known.
std::string value_for(const CLI::Option& missing, const Chain& chain) {
  if (!missing.nonpositional()) return missing.get_name(true);
  return example_value(chain[1]->get_name(), typed_name(missing));
}

/// Returns the command that was typed, with values for the missing options; an empty text if there
/// is no value for one of them.
std::string completed_command(const Chain& chain) {
  std::string text = name_of(chain);
  for (const CLI::Option* option : chain.back()->get_options()) {
    const bool missing = option->get_required() && option->count() == 0;
    if (!missing && option->count() == 0) continue;
    if (option->nonpositional()) text += " " + typed_name(*option);
    if (missing) {
      const std::string value = value_for(*option, chain);
      if (value.empty()) return {};
      text += " " + value;
    } else if (option->get_expected_max() > 0) {
      for (const std::string& value : option->results()) text += " " + shell_quoted(value);
    }
  }
  return text;
}

/// Returns the error for options that are missing; none if there are all.
std::optional<Error> missing_error(const Chain& chain, const std::string& object) {
  const std::vector<const CLI::Option*> missing = missing_options(*chain.back());
  if (missing.empty()) return std::nullopt;
  std::vector<std::string> names;
  for (const CLI::Option* option : missing) names.push_back(typed_name(*option));
  const std::string command = completed_command(chain);
  return Error(
      ErrorKind::Usage,
      fmt::format("{}{} {} missing", object, listed(names), names.size() == 1 ? "is" : "are"),
      command.empty() ? fmt::format("see {} --help", name_of(chain))
                      : fmt::format("for example: {}", command));
}

}  // namespace

Error usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const Chain chain = chosen_commands(app);
  const std::string name = name_of(chain);
  const std::string object =
      chain.size() > 1 ? name_of({chain.begin() + 1, chain.end()}) + ": " : "";
  const bool needs_command = chain.back()->get_require_subcommand_min() > 0;
  const auto word = unknown_word(chain);
  if (word && word->starts_with("-")) {
    const std::string flag = word->substr(0, word->find('='));
    return {ErrorKind::Usage, fmt::format("{}no flag '{}'", object, flag),
            remedy(flag, flag_names(chain), name)};
  }
  if (word && needs_command)
    return {ErrorKind::Usage, fmt::format("{}no command '{}'", object, *word),
            remedy(*word, command_names(*chain.back()), name)};
  if (!word && dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    if (const auto missing = missing_error(chain, object)) return *missing;
  const std::string cause = word            ? fmt::format("'{}' was not expected", *word)
                            : needs_command ? "a command is missing"
                                            : error.what();
  return {ErrorKind::Usage, object + cause, fmt::format("see {} --help", name)};
}

}  // namespace lenticule::player
