// SPDX-License-Identifier: Apache-2.0
// lenticule play --preflight: would disk and decoder keep up.
#pragma once

#include "player/exit_code.h"
#include "player/play_plan.h"

namespace lenticule::player {

/// Reads the source, or every item of a list, and prints a line for each. kQuality if one is too
/// slow. Throws Error(Input) for the first one that cannot be read.
[[nodiscard]] ExitCode run_preflight(const PlayFlags& flags, const PlayPlan& plan);

}  // namespace lenticule::player
