// SPDX-License-Identifier: Apache-2.0
// Compares pictures of method full with the reference implementation of rays (the oracle), subpixel
// by subpixel.
#pragma once

#include "apps/lenticule-bench/stability/rows.h"
#include "optics/rig.h"
#include "render/scene/scene_description.h"

namespace lenticule::bench {

struct SubpixelCode {
  int i = 0;
  int j = 0;
  int channel = 0;
  uint8_t code = 0;
};
enum class OracleVerdict {
  Same,        ///< equal within one code
  BesideOnly,  ///< equal for a slightly moved ray, or with the renderer's start offset for later
               ///< rays
  Different,
};
/// Evaluates the oracle for one subpixel of the scene under plain_stage(). Rays may be moved by
/// `hair_mm`.
[[nodiscard]] OracleVerdict ask_oracle(const render::SceneDescription& scene,
                                       const optics::Rig& rig, SubpixelCode shown, double hair_mm);

/// Renders the scene with plain_stage() and compares every subpixel with the oracle. A difference
/// of more than one code is a failure, unless the oracle gives the code for a slightly moved ray:
/// an outline lies between the two rays. The row's note states how many subpixels needed that.
[[nodiscard]] StabilityRow compare_with_oracle(const render::SceneDescription& scene,
                                               const optics::Rig& rig, const StabilitySize& size);

}  // namespace lenticule::bench
