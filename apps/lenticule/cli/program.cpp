// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/program.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <map>
#include <new>
#include <sstream>
#include <string_view>

#include "apps/lenticule/cli/error_report.h"
#include "apps/lenticule/cli/usage_error.h"
#include "base/cpu.h"
#include "base/print.h"
#include "player/process/interrupt.h"

namespace lenticule::player {
namespace {

ExitCode run_reporting_errors(const Run& run, bool as_json) {
  try {
    const ExitCode code = run();
    finish_results();
    return code;
  } catch (const Error& error) {
    return report_error(error, as_json);
  } catch (const std::bad_alloc&) {
    return report_error({ErrorKind::Failed, "out of memory", "use a smaller panel or fewer slots"},
                        as_json);
  } catch (const std::exception& error) {
    return report_error({ErrorKind::Failed, error.what()}, as_json);
  }
}

/// Prints help or the version on standard output, because they are results.
ExitCode print_help(const CLI::App& app, const CLI::ParseError& request) {
  std::ostringstream text;
  app.exit(request, text, text);
  print_out("{}", Verbatim{text.view()});
  return kOk;
}

/// Searches for --json directly, because the flags may be what cannot be parsed.
bool asks_for_json(int argc, char** argv) {
  return std::any_of(argv, argv + argc,
                     [](const char* argument) { return std::string_view(argument) == "--json"; });
}

}  // namespace

int run_program(std::span<const Command> commands, int argc, char** argv) {
  prepare_standard_streams();
  install_interrupt_handlers();
  // Choose the instruction set before the commands are declared, because their defaults name it.
  const bool as_json = asks_for_json(argc, argv);
  const auto choose_kernels = [] {
    static_cast<void>(best_isa());
    return kOk;
  };
  const ExitCode environment = run_reporting_errors(choose_kernels, as_json);
  if (environment != kOk) return environment;

  CLI::App app{"Renders, weaves and plays pictures for lenticular 3-D displays."};
  app.name("lenticule");
  app.set_version_flag("--version", std::string("lenticule ") + LENTICULE_VERSION);
  app.require_subcommand(1);
  app.footer("Start with: lenticule COMMAND --help");

  std::map<const CLI::App*, Run> runs;
  for (const Command& command : commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.summary);
    sub->footer(fmt::format("Example:\n  {}", command.example));
    runs[sub] = command.declare(*sub);
  }

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0)
      return run_reporting_errors([&] { return print_help(app, error); }, as_json);
    return report_error(usage_error(app, error), as_json);
  }
  return run_reporting_errors(runs.at(app.get_subcommands().front()), as_json);
}

}  // namespace lenticule::player
