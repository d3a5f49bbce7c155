// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/command_tree.h"

#include <CLI/CLI.hpp>
#include <algorithm>

namespace lenticule::cli {
namespace {

void add_once(std::vector<std::string>& words, const std::string& word) {
  if (std::find(words.begin(), words.end(), word) == words.end()) words.push_back(word);
}

void add_flags(std::vector<std::string>& words, const CLI::App& app) {
  for (const CLI::Option* option : flags(app))
    for (const std::string& name : option->get_lnames()) add_once(words, "--" + name);
}

}  // namespace

std::vector<const CLI::App*> visible_commands(const CLI::App& app) {
  std::vector<const CLI::App*> result;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!sub->get_group().empty()) result.push_back(sub);
  return result;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : visible_commands(app)) names.push_back(command->get_name());
  return names;
}

std::vector<const CLI::Option*> flags(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) {
    return option->nonpositional() && !option->get_group().empty();
  });
}

std::vector<const CLI::Option*> positionals(const CLI::App& app) {
  return app.get_options([](const CLI::Option* option) {
    return option->get_positional() && !option->nonpositional();
  });
}

std::vector<std::string> completion_words(const CLI::App& command) {
  std::vector<std::string> words = command_names(command);
  add_flags(words, command);
  for (const CLI::App* sub : visible_commands(command)) add_flags(words, *sub);
  return words;
}

}  // namespace lenticule::cli
