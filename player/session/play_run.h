// SPDX-License-Identifier: Apache-2.0
// run_player is one run of `lenticule play` from the plan to the exit code: it opens source and
// display, plays, reconnects a lost panel, and reports to the user, the service manager and control
// clients.
#pragma once

#include <string>

#include "base/exit_code.h"
#include "player/session/play_plan.h"
#include "player/session/play_service.h"

namespace lenticule::player {

/// Safe mode, after failed starts or on request: takes over no previous output, requests no
/// real-time priority, and shows a test card with the reason while the source cannot be played.
struct SafeStart {
  bool on = false;
  /// Shows the card before the source is tried at all, because the source may be the cause of the
  /// crashes.
  bool card_first = false;
  int failures = 0;
  std::string last_reason{};
};

/// Runs once. Throws Error for a failure that ends the run.
[[nodiscard]] ExitCode run_player(const PlayFlags& flags, PlayPlan plan,
                                  const ServiceManager& manager, SafeStart safe);

/// Carries out --preflight: reads the source, or a sample of every item of a list, and prints one
/// line for each with all problems. Returns kInput if one cannot be played or is damaged, else
/// kQuality if disk and decoder are too slow for one.
[[nodiscard]] ExitCode run_preflight(const PlayFlags& flags, const PlayPlan& plan);

}  // namespace lenticule::player
