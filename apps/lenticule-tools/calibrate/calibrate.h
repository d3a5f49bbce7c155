// SPDX-License-Identifier: Apache-2.0
// The calibration methods, one file each; `lenticule calibrate` lists them.
#pragma once

#include "apps/lenticule/cli/command.h"

namespace lenticule::tools {

/// A method, named by the word after `calibrate`: its parsed flags and the function to run.
struct CalibrateWay {
  const CLI::App* app = nullptr;
  cli::Run run;
};

}  // namespace lenticule::tools
