// SPDX-License-Identifier: Apache-2.0
// Computes the shadow of a model on the ground that it stands on.
#pragma once

#include <memory>

#include "base/interval.h"
#include "render/scene/ground_shadow.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// StandingModel describes where a model stands, in the scene frame.
struct StandingModel {
  Vec3 up, across, along;  ///< unit, perpendicular
  Interval x, y, z;        ///< bounds along across, along and up
  double ground = 0.0;     ///< height of the ground along up
  double size = 0.0;       ///< see Ground
};

/// Traces rays upwards from the ground through a committed scene with metallic-roughness materials,
/// at most 256 x 256. Returns null if the model has no size. The result does not depend on the
/// number of threads. Call it in the arena whose threads it may use.
[[nodiscard]] std::shared_ptr<const GroundShadow> cast_ground_shadow(const Scene& scene,
                                                                     const StandingModel& model);

}  // namespace lenticule::render
