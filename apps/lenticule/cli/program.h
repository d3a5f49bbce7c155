// SPDX-License-Identifier: Apache-2.0
// Runs a command-line program: finds the command, runs it, and turns an error into one line and an
// exit code.
#pragma once

#include <span>

#include "apps/lenticule/cli/command.h"

namespace lenticule::player {

/// Runs the command that `argv` names and returns the exit code for main(). Prints errors as the
/// contract of the commands says (docs/player.md). Call once, before other threads are started.
[[nodiscard]] int run_program(std::span<const Command> commands, int argc, char** argv);

}  // namespace lenticule::player
