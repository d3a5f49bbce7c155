// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/program.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <string_view>

#include "apps/lenticule/cli/help.h"
#include "apps/lenticule/cli/usage_error.h"
#include "base/main_function.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::cli {
namespace {

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
    return report_error(usage_error(app, error), style);
  } catch (const Error& error) {  // the value of a flag
    return report_error(error, style);
  }
  return run_reporting_errors(runs.at(app.get_subcommands().front()), style);
}

}  // namespace lenticule::cli
