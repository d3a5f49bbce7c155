// SPDX-License-Identifier: Apache-2.0
// Tone maps compress the light of a scene into the range that a panel shows.
#pragma once

#include <string>

#include "optics/vec.h"

namespace lenticule::render {

enum class ToneMap {
  None,        ///< light above 1 is clipped
  PbrNeutral,  ///< of Khronos: keeps base colours, compresses highlights
  Aces,        ///< fit of the ACES reference transforms by Stephen Hill, as in three.js
};

/// Returns the tone map named none, pbr-neutral or aces. Throws Error(Usage) for other names.
[[nodiscard]] ToneMap tone_map_named(const std::string& name);

/// Maps linear light to linear light that the panel shows. All three channels of the result depend
/// on all three of `light`.
[[nodiscard]] Vec3 tone_mapped(ToneMap map, Vec3 light);

}  // namespace lenticule::render
