// SPDX-License-Identifier: Apache-2.0
// lenticule man prints the manual page, and lenticule completion a script for a shell, both
// generated from the tables of --help.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <sstream>
#include <string>
#include <string_view>
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

struct ManualEntry {
  const char* tag;
  const char* text;
};
constexpr ManualEntry kExitCodes[] = {
    {"0", "success"},
    {"1", "failure"},
    {"2", "invalid command line"},
    {"3", "a device is missing, busy or not permitted"},
    {"4", "an input is invalid, or was made for another rig"},
    {"5", "a quality limit was missed"},
    {"130, 143", "interrupted by Ctrl\\-C or by SIGTERM; finished results are kept"}};

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
  text += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : kExitCodes)
    text += fmt::format(".TP\n{}\n{}\n", code, meaning);
  text +=
      ".SH ENVIRONMENT\n.TP\n\\fBLENTICULE_ISA\\fR\nlimits the instruction set: baseline, neon, "
      "avx2 or avx512\n.TP\n\\fBLENTICULE_EMBREE_ISA\\fR\nlimits that of "
      "Embree: sse2, sse4.2, avx, avx2 or avx512; with the same one, all processors render the "
      "same bytes\n";
  return text;
}

/// Returns the words among the values of an option, each with a blank: "forever " for "N|forever".
std::string value_words(const CLI::Option& option) {
  const cli::ValueType type = cli::value_type(option);
  if (type.name == "DISPLAY") return "kms virtual window ";
  std::string values = type.words.empty() ? type.name : type.words;
  std::ranges::replace(values, ',', '|');
  std::istringstream in(values);
  std::string words;
  for (std::string value; std::getline(in, value, '|');)
    if (std::ranges::none_of(value, [](char c) { return c >= 'A' && c <= 'Z'; }))
      words += value + " ";
  return words;
}

/// Returns the lines of a command, its flags that take a value, and its subcommands:
/// "PLACE:WORDS:FLAGS:DESCRIPTION". The scripts quote them with apostrophes.
std::string completion_table(const CLI::App& app, const std::string& path) {
  std::string words = app.get_prefix_command() ? "?" : "";
  std::string names;
  std::string others;
  for (const CLI::App* sub : cli::visible_commands(app)) {
    words += sub->get_name() + " ";
    others += completion_table(*sub, path + " " + sub->get_name());
  }
  for (const CLI::Option* positional : cli::positionals(app)) words += value_words(*positional);
  std::vector<const CLI::Option*> flags = cli::flags(app);
  if (app.get_fallthrough())  // the command's flags may follow its subcommand
    for (const CLI::Option* flag : cli::flags(*app.get_parent())) flags.push_back(flag);
  for (const CLI::Option* flag : flags) {
    std::istringstream all(flag->get_name(false, true));  // "-o,--output"
    for (std::string name; std::getline(all, name, ',');) {
      names += name + " ";
      if (cli::takes_value(*flag))
        others += fmt::format("{} {}:{}::\n", path, name, value_words(*flag));
    }
  }
  std::string about = app.get_description();
  about.resize(std::min(about.find('\n'), about.size()));
  std::erase(about, '\'');
  return fmt::format("{}:{}:{}:{}\n{}", path, words, names, about, others);
}

}  // namespace

cli::Run declare_man(CLI::App& app) {
  return [&app] {
    print_out("{}", Verbatim{manual(*app.get_parent())});
    return kOk;
  };
}

// lenticule completion prints a shell completion script, with a table from the same source as
// --help.

// CMake writes a source with completion.sh and completion.fish, where @table@ stands for the table.
extern const char* const kBashAndZshCompletion;
extern const char* const kFishCompletion;

cli::Run declare_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  app.add_option("shell", *shell, "bash, zsh or fish")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  return [shell, &app] {
    std::string script = *shell == "fish" ? kFishCompletion : kBashAndZshCompletion;
    constexpr std::string_view kTable = "@table@";
    script.replace(script.find(kTable), kTable.size(),
                   completion_table(*app.get_parent(), "lenticule"));
    print_out("{}", Verbatim{script});
    return kOk;
  };
}
}  // namespace lenticule::tools
