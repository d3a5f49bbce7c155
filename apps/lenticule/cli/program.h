// SPDX-License-Identifier: Apache-2.0
// run_program runs a command-line program: it finds the command, runs it, and turns an error into a
// message and an exit code.
#pragma once

#include <span>

#include "apps/lenticule/cli/command.h"

namespace lenticule::player {

/// Runs the command that `argv` names and returns the exit code for main(). Prints errors in the
/// format of the commands' contract (docs/player.md). Call it once, before other threads are
/// started.
[[nodiscard]] int run_program(std::span<const Command> commands, int argc, char** argv);

}  // namespace lenticule::player
