// SPDX-License-Identifier: Apache-2.0
// The command calibrate of a build without the calibration (LENTICULE_CALIBRATE=OFF), such as the
// demo's.
#include <CLI/CLI.hpp>

#include "apps/lenticule/cli/command.h"
#include "base/error.h"

namespace lenticule::tools {

cli::Run declare_no_calibrate(CLI::App& app) {
  app.prefix_command();
  return []() -> ExitCode {
    throw Error(ErrorKind::Failed, "calibrate: this build has no calibration",
                "scripts/packages && cmake --preset release && cmake --build --preset release");
  };
}

}  // namespace lenticule::tools
