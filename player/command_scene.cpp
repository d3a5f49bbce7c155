// SPDX-License-Identifier: Apache-2.0
// lenticule scene
#include "player/command.h"

namespace lenticule::player {

Run declare_scene(CLI::App& app) {
  (void)app;
  return []() -> ExitCode { throw Error(ErrorKind::Failed, "not built yet"); };
}

}  // namespace lenticule::player
