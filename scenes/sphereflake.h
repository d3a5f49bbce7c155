// SPDX-License-Identifier: Apache-2.0
// Spheres on spheres: each carries nine of a third of its radius.
#pragma once

#include "scenes/scene_writer.h"

namespace lenticule::scenes {

struct Ball {
  Vec3 centre;
  double radius;
  Vec3 pole;      ///< unit, away from the parent
  Vec3 meridian;  ///< unit, where the equator's first child sits
};

/// (9^(generations + 1) - 1) / 8 spheres that touch and do not intersect.
void write_sphereflake(SceneWriter& out, const Ball& ball, int generations);

}  // namespace lenticule::scenes
