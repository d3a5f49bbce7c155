// SPDX-License-Identifier: Apache-2.0
// Measures the speed of visibility against Embree alone with the same rays, for `lenticule bench
// exact`.
#pragma once

#include <cstdint>

#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::bench {

struct VisibilityTiming {
  uint64_t rays = 0;
  double bare_seconds = 0.0;  ///< Embree alone, on packets prepared in advance
  double pass_seconds = 0.0;  ///< subpixels to hits: ray set-up, checks, Embree
};

/// Traces the centre ray of every subpixel once with each method, interleaved. `threads` 0 = all
/// cores. Times are the sum over the threads divided by their number.
[[nodiscard]] VisibilityTiming time_visibility(const render::Scene& scene,
                                               const optics::OpticalModel& model, int threads);

}  // namespace lenticule::bench
