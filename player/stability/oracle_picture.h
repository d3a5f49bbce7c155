// SPDX-License-Identifier: Apache-2.0
// Pictures of method full against the oracle of rays, subpixel by subpixel.
#pragma once

#include "optics/rig.h"
#include "player/stability/rows.h"
#include "render/scene_description.h"

namespace lenticule::player {

/// Renders the scene with plain_stage() and compares every subpixel with the oracle. A code that is
/// off by more than one is a failure, unless the oracle says the same of a ray a hair beside: an
/// outline passes between. How many needed that is in the note.
[[nodiscard]] StabilityRow compare_with_oracle(const render::SceneDescription& scene,
                                               const optics::Rig& rig, const StabilitySize& size);

}  // namespace lenticule::player
