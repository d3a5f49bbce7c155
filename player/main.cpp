// SPDX-License-Identifier: Apache-2.0
// The program: finds the command, runs it, and turns what went wrong into one line and an exit
// code.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <map>
#include <new>

#include "base/print.h"
#include "player/command.h"
#include "player/interrupt.h"

namespace {

using lenticule::Error;
using lenticule::finish_results;
using lenticule::prepare_standard_streams;
using lenticule::say;
using namespace lenticule::player;

ExitCode run_reporting_errors(const Run& run) {
  try {
    const ExitCode code = run();
    finish_results();
    return code;
  } catch (const Error& error) {
    say("lenticule: {}\n", error.what());
    if (!error.hint().empty()) say("  {}\n", error.hint());
    return exit_code_of(error.kind());
  } catch (const std::bad_alloc&) {
    say("lenticule: out of memory\n  use a smaller panel or fewer ring slots\n");
    return kFailed;
  } catch (const std::exception& error) {
    say("lenticule: {}\n", error.what());
    return kFailed;
  }
}

}  // namespace

int main(int argc, char** argv) {
  prepare_standard_streams();
  install_interrupt_handlers();

  CLI::App app{"Renders, weaves and plays pictures for lenticular 3-D displays."};
  app.name("lenticule");
  app.set_version_flag("--version", std::string("lenticule ") + LENTICULE_VERSION);
  app.require_subcommand(1);
  app.footer("Start with: lenticule COMMAND --help");

  std::map<const CLI::App*, Run> runs;
  for (const Command& command : commands()) {
    CLI::App* sub = app.add_subcommand(command.name, command.summary);
    sub->footer(fmt::format("Example:\n  {}", command.example));
    runs[sub] = command.declare(*sub);
  }

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    const auto chosen = app.get_subcommands();
    say("lenticule: {}\n  see lenticule {}--help\n", error.what(),
        chosen.empty() ? "" : chosen.front()->get_name() + " ");
    return kUsage;
  }
  return run_reporting_errors(runs.at(app.get_subcommands().front()));
}
