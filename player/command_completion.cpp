// SPDX-License-Identifier: Apache-2.0
// lenticule completion
#include "player/command.h"

namespace lenticule::player {

Run declare_completion(CLI::App& app) {
  (void)app;
  return []() -> ExitCode { throw Error(ErrorKind::Failed, "not built yet"); };
}

}  // namespace lenticule::player
