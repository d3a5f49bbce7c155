// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/usage_error.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

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
  const std::string cause = word            ? fmt::format("'{}' was not expected", *word)
                            : needs_command ? "a command is missing"
                                            : error.what();
  return {ErrorKind::Usage, object + cause, fmt::format("see {} --help", name)};
}

}  // namespace lenticule::player
