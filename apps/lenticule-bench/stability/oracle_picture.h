// SPDX-License-Identifier: Apache-2.0
// Pictures of method full against the oracle of rays, subpixel by subpixel.
#pragma once

#include "apps/lenticule-bench/stability/rows.h"
#include "optics/rig.h"
#include "render/scene/scene_description.h"

namespace lenticule::player {

struct SubpixelCode {
  int i = 0;
  int j = 0;
  int channel = 0;
  uint8_t code = 0;
};
enum class OracleVerdict {
  Same,        ///< within one code
  BesideOnly,  ///< of a ray a hair beside, or with later rays that start as far off as renderers'
  Different,
};
/// What the oracle says of one subpixel of the scene under plain_stage().
[[nodiscard]] OracleVerdict ask_oracle(const render::SceneDescription& scene,
                                       const optics::Rig& rig, SubpixelCode shown, double hair_mm);

/// Renders the scene with plain_stage() and compares every subpixel with the oracle. A code that is
/// off by more than one is a failure, unless the oracle says the same of a ray a hair beside: an
/// outline passes between. How many needed that is in the note.
[[nodiscard]] StabilityRow compare_with_oracle(const render::SceneDescription& scene,
                                               const optics::Rig& rig, const StabilitySize& size);

}  // namespace lenticule::player
