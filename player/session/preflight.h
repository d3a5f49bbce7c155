// SPDX-License-Identifier: Apache-2.0
// lenticule play --preflight: would disk and decoder keep up.
#pragma once

#include "base/exit_code.h"
#include "player/session/play_plan.h"

namespace lenticule::player {

/// Reads the source, or a sample of every item of a list, and prints a line for each: all that is
/// wrong with all of them. kInput if one cannot be played or is damaged, else kQuality if one is
/// too slow.
[[nodiscard]] ExitCode run_preflight(const PlayFlags& flags, const PlayPlan& plan);

}  // namespace lenticule::player
