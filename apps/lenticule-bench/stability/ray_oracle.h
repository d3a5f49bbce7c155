// SPDX-License-Identifier: Apache-2.0
// What a ray sees, in long double, every ray against every primitive, for `bench stability`. Knows
// glowing, mirroring and transparent materials; no lamps, no ambient light. Shares no code with
// render/ but the plain data of a scene.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::player {

using Real3 = Vec3T<long double>;

struct OracleLine {
  Real3 from;
  Real3 way;  ///< any length
};

/// What comes back along the line, one colour channel, linear. Starts at `from`; mirrored and
/// refracted rays start so far off their surfaces.
[[nodiscard]] long double oracle_light(const render::SceneDescription& scene,
                                       const OracleLine& line, int channel, int max_depth,
                                       long double start_off = 0);

/// How far away the line ends, in lengths of `way`; infinite where it does not.
[[nodiscard]] long double oracle_distance(const render::SceneDescription& scene,
                                          const OracleLine& line);

}  // namespace lenticule::player
