// SPDX-License-Identifier: Apache-2.0
// lenticule plays, and passes the commands that it does not run itself on to lenticule-tools. So it
// starts fast, and a machine with a panel needs few libraries.
#include "apps/lenticule/cli/program.h"

int main(int argc, char** argv) {
  using namespace lenticule::cli;
  constexpr OtherProgram kTools = {.name = "lenticule-tools", .package = "lenticule"};
  return run_program({.commands = commands(),
                      .declared = player_commands(),
                      .others = &kTools,
                      .first_steps = kFirstSteps},
                     argc, argv);
}
