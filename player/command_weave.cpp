// SPDX-License-Identifier: Apache-2.0
// lenticule weave
#include "player/command.h"

namespace lenticule::player {

Run declare_weave(CLI::App& app) {
  (void)app;
  return []() -> ExitCode { throw Error(ErrorKind::Failed, "not built yet"); };
}

}  // namespace lenticule::player
