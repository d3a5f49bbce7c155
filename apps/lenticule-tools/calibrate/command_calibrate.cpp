// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate selects the calibration method by its name. A build without the calibration
// (LENTICULE_CALIBRATE=OFF), such as the demo's, says so.
#include <CLI/CLI.hpp>

#include "apps/lenticule/cli/command.h"
#include "base/error.h"
#ifdef LENTICULE_CALIBRATE
#include "apps/lenticule-tools/calibrate/calibrate_result.h"
#endif

namespace lenticule::tools {

#ifdef LENTICULE_CALIBRATE
// Each is defined in the file of its method.
CalibrateWay declare_calibrate_camera(CLI::App& app);
CalibrateWay declare_calibrate_photos(CLI::App& app);
CalibrateWay declare_calibrate_phone(CLI::App& app);
CalibrateWay declare_calibrate_by_eye(CLI::App& app);
CalibrateWay declare_calibrate_show(CLI::App& app);

cli::Run declare_calibrate(CLI::App& app) {
  app.require_subcommand(1);
  const std::vector<CalibrateWay> ways = {
      declare_calibrate_camera(app), declare_calibrate_photos(app), declare_calibrate_phone(app),
      declare_calibrate_by_eye(app), declare_calibrate_show(app)};
  return [ways]() -> ExitCode {
    for (const CalibrateWay& way : ways)
      if (way.app->parsed()) return way.run();
    throw Error(ErrorKind::Usage, "calibrate: a subcommand is missing",
                "see lenticule calibrate --help");
  };
}
#else
cli::Run declare_calibrate(CLI::App& app) {
  app.prefix_command();
  return []() -> ExitCode {
    throw Error(ErrorKind::Failed, "calibrate: this build has no calibration",
                "scripts/packages && cmake --preset release && cmake --build --preset release");
  };
}
#endif

}  // namespace lenticule::tools
