// SPDX-License-Identifier: Apache-2.0
// The program: finds the command, runs it, and turns what went wrong into one line and an exit
// code.
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <map>
#include <new>

#include "player/command.h"
#include "player/confined_pictures.h"
#include "player/interrupt.h"

namespace {

using lenticule::Error;
using namespace lenticule::player;

ExitCode run_reporting_errors(const Run& run) {
  try {
    const ExitCode code = run();
    // A result that did not reach the disk or the pipe is not a result.
    if (std::fflush(stdout) != 0)
      throw Error(lenticule::ErrorKind::Failed, "standard output: cannot write");
    return code;
  } catch (const Error& error) {
    fmt::print(stderr, "lenticule: {}\n", error.what());
    if (!error.hint().empty()) fmt::print(stderr, "  {}\n", error.hint());
    return exit_code_of(error.kind());
  } catch (const std::bad_alloc&) {
    fmt::print(stderr, "lenticule: out of memory\n  use a smaller panel or fewer ring slots\n");
    return kFailed;
  } catch (const std::exception& error) {
    fmt::print(stderr, "lenticule: {}\n", error.what());
    return kFailed;
  }
}

/// The number of a standard descriptor that is closed would go to the next file that is opened, and
/// what is read or printed would meet that.
void fill_standard_descriptors() {
  int fd = 0;
  do {
    fd = open("/dev/null", O_RDWR);
  } while (fd >= 0 && fd <= STDERR_FILENO);
  if (fd >= 0) close(fd);
}

}  // namespace

int main(int argc, char** argv) {
  fill_standard_descriptors();
  install_interrupt_handlers();
  const ConfinedPictures pictures;
  lenticule::frames::use_picture_reader(&pictures);

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
    fmt::print(stderr, "lenticule: {}\n  see lenticule {}--help\n", error.what(),
               chosen.empty() ? "" : chosen.front()->get_name() + " ");
    return kUsage;
  }
  return run_reporting_errors(runs.at(app.get_subcommands().front()));
}
