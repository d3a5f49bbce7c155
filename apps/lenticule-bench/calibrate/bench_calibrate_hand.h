// SPDX-License-Identifier: Apache-2.0
// lenticule bench calibrate --hand calibrates random workshops from photographs that a phone takes
// by hand, and counts right, refused and wrong results; with --wrong-ways, photographs are taken or
// treated in ways that spoil them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/lenticule-bench/phone/workshop.h"
#include "base/exit_code.h"

namespace lenticule::bench {

struct CalibrateHandFlags {
  int draws = 10;
  uint64_t first = 1;
  int panel_width = 3840;
  int phone_width = 4000;
  std::vector<int> photographs = {2, 3, 4, 6};
  std::string plot;
  bool wrong_ways = false;
  bool json = false;
};

/// Returns the limits of the workshops for these flags.
[[nodiscard]] WorkshopLimits limits_of(const CalibrateHandFlags& flags);

/// Return kQuality if a wrong result is accepted.
ExitCode run_calibrate_hand(const CalibrateHandFlags& flags);
ExitCode run_calibrate_wrong(const CalibrateHandFlags& flags);

}  // namespace lenticule::bench
