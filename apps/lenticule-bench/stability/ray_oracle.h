// SPDX-License-Identifier: Apache-2.0
// A reference ray tracer (oracle) in long double that tests every ray against every primitive, for
// `bench stability`. It supports glowing, mirroring and transparent materials, and neither lights
// nor ambient light. It shares no code with render/ except the plain data of a scene.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::bench {

using Real3 = Vec3T<long double>;

struct OracleLine {
  Real3 from;
  Real3 way;  ///< direction, of any length
};

/// Returns the light along the line, for one colour channel, linear. The line starts at `from`;
/// mirrored and refracted rays start at a distance of `start_off` from their surfaces.
[[nodiscard]] long double oracle_light(const render::SceneDescription& scene,
                                       const OracleLine& line, int channel, int max_depth,
                                       long double start_off = 0);

/// Returns the distance to the first surface in lengths of `way`; infinite if there is none.
[[nodiscard]] long double oracle_distance(const render::SceneDescription& scene,
                                          const OracleLine& line);

}  // namespace lenticule::bench
