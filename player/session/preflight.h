// SPDX-License-Identifier: Apache-2.0
// Implements lenticule play --preflight: tests whether disk and decoder are fast enough.
#pragma once

#include "base/exit_code.h"
#include "player/session/play_plan.h"

namespace lenticule::player {

/// Reads the source, or a sample of every item of a list, and prints one line for each with all
/// problems. Returns kInput if one cannot be played or is damaged, else kQuality if one is too
/// slow.
[[nodiscard]] ExitCode run_preflight(const PlayFlags& flags, const PlayPlan& plan);

}  // namespace lenticule::player
