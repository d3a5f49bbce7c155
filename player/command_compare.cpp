// SPDX-License-Identifier: Apache-2.0
// lenticule compare
#include "player/command.h"

namespace lenticule::player {

Run declare_compare(CLI::App& app) {
  (void)app;
  return []() -> ExitCode { throw Error(ErrorKind::Failed, "not built yet"); };
}

}  // namespace lenticule::player
