// SPDX-License-Identifier: Apache-2.0
// lenticule man prints the manual page, and lenticule completion a script for a shell, both
// generated from the tables of --help.
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

/// Escapes text that troff would take for a request or an escape.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool begins_line = out.empty() || out.back() == '\n';
    if (begins_line && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if (c == '\n') {
      out += "\n.br\n";
    } else {
      out += c;
    }
  }
  return out;
}

std::string option_entry(const CLI::Option& option) {
  return fmt::format(".TP\n\\fB{}\\fR\n{}\n", roff(cli::typed_form(option)),
                     roff(explanation(option, cli::HelpLength::Long)));
}

std::string command_section(const CLI::App& app, const std::string& prefix) {
  std::string arguments;
  for (const CLI::Option* positional : cli::positionals(app))
    arguments += " \\fI" + roff(positional->get_name(true)) + "\\fR";
  std::string text =
      fmt::format(".SS {}\n\\fB{}\\fR{} [options]\n.PP\n{}\n", roff(prefix + app.get_name()),
                  roff(prefix + app.get_name()), arguments, roff(app.get_description()));
  for (const CLI::Option* positional : cli::positionals(app)) text += option_entry(*positional);
  for (const CLI::Option* flag : cli::flags(app))
    if (flag->get_name() != "--help") text += option_entry(*flag);
  for (const CLI::App* sub : cli::visible_commands(app))
    text += command_section(*sub, prefix + app.get_name() + " ");
  return text;
}

constexpr const char* kExitCodes =
    ".SH EXIT STATUS\n"
    ".TP\n"
    "0\n"
    "success\n"
    ".TP\n"
    "1\n"
    "failure\n"
    ".TP\n"
    "2\n"
    "invalid command line\n"
    ".TP\n"
    "3\n"
    "a device is missing, busy or not permitted\n"
    ".TP\n"
    "4\n"
    "an input is invalid, or was made for another rig\n"
    ".TP\n"
    "5\n"
    "a quality limit was missed\n"
    ".TP\n"
    "130, 143\n"
    "interrupted by Ctrl\\-C or by SIGTERM; finished results are kept\n";

std::string manual(const CLI::App& root) {
  std::string text = fmt::format(
      ".TH LENTICULE 1 \"\" \"lenticule {}\" \"User Commands\"\n"
      ".SH NAME\nlenticule \\- driver, player and renderer for lenticular 3\\-D displays\n"
      ".SH SYNOPSIS\n.B lenticule\n\\fICOMMAND\\fR [options]\n"
      ".SH DESCRIPTION\n{}\nResults go to standard output, everything else to standard error.\n"
      ".SH COMMANDS\n",
      LENTICULE_VERSION, roff(root.get_description()));
  for (const CLI::App* command : cli::visible_commands(root)) text += command_section(*command, "");
  text += ".SH EXAMPLES\n";
  for (const cli::Command& command : cli::commands())
    if (command.example[0] != '\0')
      text += fmt::format(".TP\n{}\n\\fB{}\\fR\n", roff(command.summary), roff(command.example));
  text += kExitCodes;
  text +=
      ".SH ENVIRONMENT\n.TP\n\\fBLENTICULE_ISA\\fR\nlimits the instruction set: baseline, neon, "
      "avx2 or avx512\n.TP\n\\fBLENTICULE_EMBREE_ISA\\fR\nlimits that of "
      "Embree: sse2, sse4.2, avx, avx2 or avx512; with the same one, all processors render the "
      "same "
      "bytes\n";
  return text;
}

}  // namespace

cli::Run declare_man(CLI::App& app) {
  return [&app] {
    print_out("{}", Verbatim{manual(*app.get_parent())});
    return kOk;
  };
}

// lenticule completion prints a shell completion script, generated from the same tables as --help.

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
