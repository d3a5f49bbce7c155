// SPDX-License-Identifier: Apache-2.0
// Sphereflake: spheres on spheres; each sphere carries nine spheres of a third of its radius.
#pragma once

#include "scenes/scene_writer.h"

namespace lenticule::scenes {

struct Ball {
  Vec3 centre;
  double radius;
  Vec3 pole;      ///< unit, away from the parent
  Vec3 meridian;  ///< unit, toward the first child on the equator
};

/// Writes (9^(generations + 1) - 1) / 8 spheres that touch but do not intersect.
void write_sphereflake(SceneWriter& out, const Ball& ball, int generations);

}  // namespace lenticule::scenes
