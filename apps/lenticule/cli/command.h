// SPDX-License-Identifier: Apache-2.0
// Command is an entry of the command table, Declaration connects it with its code: one file per
// command, one row in commands.cpp, which every program has, and one declaration in the program
// that runs the command.
#pragma once

#include <functional>
#include <span>

#include "base/exit_code.h"
#include "base/json_output.h"

// CLI11's header takes seconds to compile, so only files that declare flags include it.
namespace CLI {
class App;
}

namespace lenticule::cli {

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
};

struct Declaration {
  const char* command;  ///< name in the table
  Declare declare;
};

/// Returns all commands, in the order in which --help lists them.
[[nodiscard]] std::span<const Command> commands();
/// Returns the declarations of the commands that a machine with a panel needs. They use no library
/// for rendering, calibration, pictures or videos.
[[nodiscard]] std::span<const Declaration> player_commands();

/// Lines that --help shows before the list of commands, and that a call without a command prints.
inline constexpr const char* kFirstSteps = R"(
  play a film on a panel    lenticule play film.lts --display kms
  show a quilt or a video   lenticule play views_qs8x6a0.75.png --display kms
  render a scene            lenticule render builtin:demo -o woven.png
  calibrate a lens sheet    lenticule calibrate by-eye --rig start.toml --display kms -o lobby.toml
  check a panel             lenticule doctor
)";

}  // namespace lenticule::cli
