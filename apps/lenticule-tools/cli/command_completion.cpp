// SPDX-License-Identifier: Apache-2.0
// lenticule completion prints a shell completion script, generated from the same tables as --help.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <vector>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/help.h"
#include "base/print.h"

namespace lenticule::tools {
namespace {

std::string joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " "));
}

std::string bash_script(const CLI::App& root) {
  std::string cases;
  for (const CLI::App* command : cli::visible_commands(root))
    cases += fmt::format("    {}) words=\"{}\" ;;\n", command->get_name(),
                         joined(cli::completion_words(*command)));
  return fmt::format(R"(# bash completion for lenticule
_lenticule() {{
  local current="${{COMP_WORDS[COMP_CWORD]}}" words=""
  case "${{COMP_WORDS[1]}}" in
{}    *) words="{}" ;;
  esac
  if [[ $COMP_CWORD -eq 1 ]]; then words="{}"; fi
  COMPREPLY=($(compgen -W "$words" -- "$current"))
  if [[ ${{#COMPREPLY[@]}} -eq 0 ]]; then COMPREPLY=($(compgen -f -- "$current")); fi
}}
complete -o filenames -F _lenticule lenticule
)",
                     cases, joined(cli::command_names(root)), joined(cli::command_names(root)));
}

std::string zsh_script(const CLI::App& root) {
  std::string cases;
  for (const CLI::App* command : cli::visible_commands(root))
    cases += fmt::format("    {}) compadd -- {}; _files ;;\n", command->get_name(),
                         joined(cli::completion_words(*command)));
  return fmt::format(R"(#compdef lenticule
# zsh completion for lenticule
_lenticule() {{
  if (( CURRENT == 2 )); then
    compadd -- {}
    return
  fi
  case "$words[2]" in
{}  esac
}}
compdef _lenticule lenticule
)",
                     joined(cli::command_names(root)), cases);
}

std::string fish_script(const CLI::App& root) {
  std::string lines = "# fish completion for lenticule\n";
  for (const CLI::App* command : cli::visible_commands(root)) {
    lines += fmt::format("complete -c lenticule -n __fish_use_subcommand -a {} -d '{}'\n",
                         command->get_name(), command->get_description());
    lines += fmt::format("complete -c lenticule -n '__fish_seen_subcommand_from {}' -a '{}'\n",
                         command->get_name(), joined(cli::completion_words(*command)));
  }
  return lines;
}

}  // namespace

cli::Run declare_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  app.add_option("shell", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  return [shell, &app] {
    const CLI::App& root = *app.get_parent();
    const std::string script = *shell == "bash"  ? bash_script(root)
                               : *shell == "zsh" ? zsh_script(root)
                                                 : fish_script(root);
    print_out("{}", Verbatim{script});
    return kOk;
  };
}

}  // namespace lenticule::tools
