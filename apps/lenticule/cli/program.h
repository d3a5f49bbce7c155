// SPDX-License-Identifier: Apache-2.0
// run_program runs a command-line program: it finds the command, runs it, and turns an error into a
// message and an exit code.
#pragma once

#include <span>

#include "apps/lenticule/cli/command.h"
#include "apps/lenticule/cli/other_program.h"

namespace lenticule::cli {

struct Program {
  std::span<const Command> commands;
  std::span<const Declaration> declared;
  /// The program that runs the commands that are not declared; null if all are.
  const OtherProgram* others = nullptr;
  const char* first_steps = "";
};

/// Runs the command that `argv` names and returns the exit code for main(), or replaces this
/// process by the program that has the command. Prints errors in the format of the commands'
/// contract (docs/play/player.md). Call it once, before other threads are started.
[[nodiscard]] int run_program(const Program& program, int argc, char** argv);

}  // namespace lenticule::cli
