// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/program.h"

int main(int argc, char** argv) {
  return lenticule::player::run_program(lenticule::player::commands(), argc, argv);
}
