// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule/cli/program.h"

namespace {

constexpr const char* kFirstSteps = R"(
  play a film on a panel    lenticule play film.lts --rig lobby.toml --display kms
  show a quilt or a video   lenticule play views_qs8x6a0.75.png --rig lobby.toml --display kms
  render a scene            lenticule render teapot.nff --rig lobby.toml -o woven.png
  calibrate a lens sheet    lenticule calibrate by-eye --rig start.toml --display kms -o lobby.toml
  check a panel             lenticule doctor
)";

}  // namespace

int main(int argc, char** argv) {
  return lenticule::player::run_program(
      {.commands = lenticule::player::commands(), .first_steps = kFirstSteps}, argc, argv);
}
