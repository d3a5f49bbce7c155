// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/program.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "apps/lenticule/cli/help.h"
#include "base/error_kinds.h"
#include "base/installation.h"
#include "base/main_function.h"
#include "base/numbers.h"
#include "base/print.h"
#include "base/text.h"
#include "frames/picture_codec.h"
#include "player/process/interrupt.h"
#include "player/sources/confined_pictures.h"

namespace lenticule::cli {
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

/// Words that other programs have for our commands.
constexpr std::array<std::pair<std::string_view, std::string_view>, 11> kOtherWords = {{
    {"black", "blank"},
    {"stop", "quit"},
    {"exit", "quit"},
    {"kill", "quit"},
    {"resume", "play"},
    {"continue", "play"},
    {"skip", "next"},
    {"prev", "previous"},
    {"jump", "seek"},
    {"info", "status"},
    {"screenshot", "snapshot"},
}};

std::string remedy(std::string_view word, const std::vector<std::string>& known,
                   const std::string& name) {
  for (const auto& [other, ours] : kOtherWords)
    if (word == other && std::ranges::find(known, ours) != known.end()) word = ours;
  const std::vector<std::string_view> views(known.begin(), known.end());
  const auto nearest = nearest_word(word, views);
  return nearest ? fmt::format("did you mean '{}'? see {} --help", *nearest, name)
                 : fmt::format("see {} --help", name);
}

std::string remedy_of_flag(const std::string& flag, const Chain& chain) {
  const std::vector<std::string> known = flag_names(chain);
  if (!flag.starts_with("--") && flag.size() > 2)
    return fmt::format("write ./{} if it is a file; see {} --help", flag, name_of(chain));
  if (std::ranges::find(known, flag) != known.end()) return "write it after the command";
  return remedy(flag, known, name_of(chain));
}

std::string remedy_of_command(const std::string& word, const Chain& chain) {
  std::error_code ignored;
  if (chain.size() == 1 && std::filesystem::exists(word, ignored))
    return fmt::format("to play it: lenticule play {}", shell_quoted(word));
  return remedy(word, command_names(*chain.back()), name_of(chain));
}

/// Returns what to write in place of an argument that the command does not have.
std::string remedy_of_argument(const std::string& word, const Chain& chain) {
  const std::string name = name_of(chain);
  if (name == "lenticule ctl play")
    return fmt::format("to load it: lenticule ctl load {}; 'play' continues after a pause",
                       shell_quoted(word));
  const std::vector<std::string> known = flag_names({chain.back()});
  if (number_from<uint64_t>(word) && std::ranges::find(known, "--frame") != known.end())
    return fmt::format("write --frame {}; see {} --help", word, name);
  return fmt::format("see {} --help", name);
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

/// Returns the argument that the example of the chosen command has in the place of a positional, or
/// an empty text.
std::string example_argument(const Chain& chain, const CLI::Option& positional) {
  const std::vector<const CLI::Option*> all = positionals(*chain.back());
  const auto index = std::ranges::find(all, &positional) - all.begin();
  for (const Command& one : commands()) {
    std::string_view rest = one.example;
    const std::string command = name_of(chain) + " ";
    if (!rest.starts_with(command)) continue;
    rest.remove_prefix(command.size());
    for (int k = 0; k < index; ++k) rest.remove_prefix(std::min(rest.find(' ') + 1, rest.size()));
    return rest.starts_with('-') ? "" : std::string(rest.substr(0, rest.find(' ')));
  }
  return {};
}

/// Returns a value for a missing option, or an empty text if none is known.
std::string value_for(const CLI::Option& missing, const Chain& chain) {
  if (!missing.nonpositional()) return example_argument(chain, missing);
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

// ---- values that are refused

std::string expected_value(const CLI::Option& option, bool is_fraction) {
  const ValueType type = value_type(option);
  if (!type.words.empty()) return "expected one of " + type.words;
  const std::string number =
      is_fraction || type.whole ? "expected a whole number" : "expected a number";
  return type.limits.empty() ? number : number + " " + type.limits;
}

/// Returns the error for the value of an option that CLI11 refused; none if the error is of another
/// kind. CLI11 names the option only in the text of its error.
std::optional<Error> value_error(const Chain& chain, const std::string& object,
                                 std::string_view error) {
  for (const CLI::App* command : chain)
    for (const CLI::Option* option : command->get_options()) {
      const std::string name = option->get_name();
      const bool out_of_range = error.starts_with(name + ": ");
      if (!out_of_range && !error.starts_with(fmt::format("Could not convert: {} ", name)))
        continue;
      const std::string typed = object + typed_name(*option);
      const std::string help = fmt::format("see {} --help", name_of(chain));
      const int most = option->get_items_expected_max();
      if (option->count() == 0)
        return Error(ErrorKind::Usage, typed + ": its value is missing", help);
      if (most == 0) return Error(ErrorKind::Usage, typed + ": takes no value", help);
      if (static_cast<int>(option->count()) > std::max(1, most))
        return Error(ErrorKind::Usage, typed + ": given more than once", help);
      const std::string& value = option->results().back();
      const bool is_fraction = !out_of_range && number_from<double>(value).has_value();
      return Error(ErrorKind::Usage,
                   fmt::format("{} '{}': {}", typed, value, expected_value(*option, is_fraction)),
                   value.find(',') == std::string::npos ? help : "write a point, not a comma");
    }
  return std::nullopt;
}

/// Returns the Error(Usage) for a command line that `app` could not parse. An unknown command or
/// flag is reported first, with the most similar known one, because other errors usually follow
/// from it.
Error error_of_words(const CLI::App& app, const CLI::ParseError& error) {
  const Chain chain = chosen_commands(app);
  const std::string name = name_of(chain);
  const std::string object =
      chain.size() > 1 ? name_of({chain.begin() + 1, chain.end()}) + ": " : "";
  const bool needs_command = chain.back()->get_require_subcommand_min() > 0;
  const auto word = unknown_word(chain);
  if (word && word->starts_with("-")) {
    const std::string flag = word->substr(0, word->find('='));
    return {ErrorKind::Usage, fmt::format("{}no flag '{}'", object, flag),
            remedy_of_flag(flag, chain)};
  }
  if (word && needs_command)
    return {ErrorKind::Usage, fmt::format("{}no command '{}'", object, *word),
            remedy_of_command(*word, chain)};
  if (!word && dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    if (const auto missing = missing_error(chain, object)) return *missing;
  if (const auto refused = word ? std::nullopt : value_error(chain, object, error.what()))
    return *refused;
  if (word)
    return {ErrorKind::Usage, fmt::format("{}'{}' was not expected", object, *word),
            remedy_of_argument(*word, chain)};
  const std::string cause = needs_command ? "a command is missing" : error.what();
  return {ErrorKind::Usage, object + cause, fmt::format("see {} --help", name)};
}

/// Searches for --json directly, because the flags may be what cannot be parsed.
bool asks_for_json(int argc, char** argv) {
  return std::any_of(argv, argv + argc,
                     [](const char* argument) { return std::string_view(argument) == "--json"; });
}

/// Returns the declaration of a command; null if another program has it.
Declare declare_of(const Program& program, std::string_view command) {
  const auto found = std::find_if(program.declared.begin(), program.declared.end(),
                                  [&](const Declaration& one) { return command == one.command; });
  return found != program.declared.end() ? found->declare : nullptr;
}

/// Returns the command that the arguments name, if another program has it. No flag before the
/// command takes a value.
const Command* command_of_another(const Program& program, int argc, char** argv) {
  char** const word = std::find_if(argv + std::min(argc, 1), argv + argc,
                                   [](const char* one) { return one[0] != '-'; });
  if (word == argv + argc) return nullptr;
  for (const Command& command : program.commands)
    if (std::string_view(*word) == command.name)
      return declare_of(program, command.name) == nullptr ? &command : nullptr;
  return nullptr;
}

}  // namespace

void become_program(const OtherProgram& program, const char* command, char* const* arguments) {
  const std::string path = require_program(command, program.name, program.package).string();
  execv(path.c_str(), arguments);
  throw failed_error("{}: cannot start {}: {}", command, path, std::strerror(errno));
}

int run_program(const Program& program, int argc, char** argv) {
  const ErrorStyle style{.program = "lenticule",
                         .as_json = asks_for_json(argc, argv),
                         .memory_hint = "use a smaller panel or fewer slots"};
  // The commands' declarations name the instruction set that is chosen here.
  if (const int code = prepare_program(style); code != kOk) return code;
  if (const Command* command = command_of_another(program, argc, argv)) {
    LENTICULE_CHECK(program.others != nullptr);
    return run_reporting_errors(
        [&]() -> int { become_program(*program.others, command->name, argv); }, style);
  }
  player::install_interrupt_handlers();

  CLI::App app{std::string("Renders, weaves and plays pictures for lenticular 3-D displays.\n") +
               program.first_steps};
  app.name("lenticule");
  app.formatter(make_help_formatter());
  app.set_version_flag("--version", std::string("lenticule ") + LENTICULE_VERSION);
  app.require_subcommand(1);
  app.footer("Start with: lenticule COMMAND --help");

  std::map<const CLI::App*, Run> runs;
  for (const Command& command : program.commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.summary);
    sub->footer(fmt::format("Example:\n  {}", command.example));
    if (const Declare declare = declare_of(program, command.name)) runs[sub] = declare(*sub);
  }

  if (argc == 1 && program.first_steps[0] != '\0') {
    say("{}\nAll commands: lenticule --help\n", Verbatim{program.first_steps});
    return kUsage;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return print_help(app, error, style);
    return report_error(error_of_words(app, error), style);
  } catch (const Error& error) {  // the value of a flag
    return report_error(error, style);
  }
#ifdef LENTICULE_VIDEO
  // This process has the rights of its user, so other processes without rights decode pictures.
  const player::ConfinedPictures pictures;
  frames::use_picture_reader(&pictures);
#endif
  const auto run = [&]() -> int {
    try {
      return runs.at(app.get_subcommands().front())();
    } catch (const player::Interrupted&) {
      return player::interrupt_exit_code();
    }
  };
  return run_reporting_errors(run, style);
}

}  // namespace lenticule::cli
