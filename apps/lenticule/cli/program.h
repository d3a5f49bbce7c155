// SPDX-License-Identifier: Apache-2.0
// run_program runs a command-line program: it finds the command, runs it, and turns an error into a
// message and an exit code.
#pragma once

#include <span>

#include "apps/lenticule/cli/command.h"

namespace lenticule::cli {

/// OtherProgram is a program of lenticule that has a package of its own, because it needs libraries
/// that a machine with a panel does without.
struct OtherProgram {
  const char* name;
  const char* package;
};

/// Replaces this process by the program. `arguments` ends with a null pointer; arguments[0] is the
/// name in lists of processes. Throws Error(Failed) with `command` as object if the program is not
/// installed or cannot be started.
[[noreturn]] void become_program(const OtherProgram& program, const char* command,
                                 char* const* arguments);

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
