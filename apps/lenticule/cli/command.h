// SPDX-License-Identifier: Apache-2.0
// How a command plugs into the program: one file per command, one line in commands.cpp.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/exit_code.h"
#include "base/json_output.h"

// Its header takes seconds to compile; only those who declare flags include it.
namespace CLI {
class App;
}

namespace lenticule::player {

/// What a command does once its flags are parsed. Throws lenticule::Error for what the world did
/// wrong; main() prints it and maps its kind to the exit code.
using Run = std::function<ExitCode()>;

/// Declares a command's flags on `app` (a fresh subcommand) and returns what to run. Options live
/// in a shared_ptr that the returned function captures.
using Declare = Run (*)(CLI::App& app);

struct Command {
  const char* name;
  const char* summary;
  const char* example;  ///< shown at the end of --help
  Declare declare;
};

/// Every command, in the order in which --help lists them.
[[nodiscard]] const std::vector<Command>& commands();

}  // namespace lenticule::player
