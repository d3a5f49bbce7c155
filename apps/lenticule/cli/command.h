// SPDX-License-Identifier: Apache-2.0
// Command is an entry of the command table: one file per command, one line in commands.cpp.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/exit_code.h"
#include "base/json_output.h"

// CLI11's header takes seconds to compile, so only files that declare flags include it.
namespace CLI {
class App;
}

namespace lenticule::player {

/// The function that runs a command after its flags are parsed. Throws lenticule::Error for errors
/// of input or environment; main() prints it and maps its kind to the exit code.
using Run = std::function<ExitCode()>;

/// Declares a command's flags on `app` (a new subcommand) and returns the function to run. The
/// options live in a shared_ptr that this function captures.
using Declare = Run (*)(CLI::App& app);

struct Command {
  const char* name;
  const char* summary;
  const char* example;  ///< shown at the end of --help
  Declare declare;
};

/// Returns all commands, in the order in which --help lists them.
[[nodiscard]] const std::vector<Command>& commands();

}  // namespace lenticule::player
