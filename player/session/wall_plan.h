// SPDX-License-Identifier: Apache-2.0
// plan_wall plans how one player shows the panels of a wall that are connected to one graphics
// card: each plays its own film, and one commit changes all of them.
#pragma once

#include "player/session/play_plan.h"

namespace lenticule::player {

/// Reads the wall of `flags` with its rigs, and sets source and display of the plan. Throws
/// Error(Usage) for flags that need one rig, Error(Input) for files that are not valid.
void plan_wall(const PlayFlags& flags, PlayPlan& plan);

}  // namespace lenticule::player
