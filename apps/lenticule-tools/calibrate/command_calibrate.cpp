// SPDX-License-Identifier: Apache-2.0
// lenticule calibrate selects the calibration method by its name.
#include <CLI/CLI.hpp>

#include "apps/lenticule-tools/calibrate/calibrate.h"
#include "base/error.h"

namespace lenticule::tools {

// Each is defined in its own file, calibrate_METHOD.cpp.
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

}  // namespace lenticule::tools
