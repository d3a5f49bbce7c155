// SPDX-License-Identifier: Apache-2.0
// lenticule bench calibrate --stress runs the stress cases of calibration and prints their results.
#pragma once

#include <string>

#include "apps/lenticule/cli/command.h"

namespace lenticule::bench {

struct CalibrateStressFlags {
  bool stress = false;
  bool full = false;
  std::string only;  ///< the name of one case; empty = all
  bool json = false;
};

/// Prints a line per case. Returns kQuality if a case misses its limit; throws Error(Usage) for an
/// unknown name.
[[nodiscard]] ExitCode run_calibrate_stress(const CalibrateStressFlags& flags);

}  // namespace lenticule::bench
