// SPDX-License-Identifier: Apache-2.0
// The ways of calibrating, one file each; `lenticule calibrate` lists them.
#pragma once

#include "apps/lenticule/cli/command.h"

namespace lenticule::player {

/// One word after `calibrate`: its parsed flags and what to run when it was given.
struct CalibrateWay {
  const CLI::App* app = nullptr;
  Run run;
};

}  // namespace lenticule::player
