// SPDX-License-Identifier: Apache-2.0
// How fast visibility is, against the best that Embree does with the same rays: for `lenticule
// bench exact`.
#pragma once

#include <cstdint>

#include "optics/model.h"
#include "render/scene/scene.h"

namespace lenticule::render {

struct VisibilityTiming {
  uint64_t rays = 0;
  double bare_seconds = 0.0;  ///< Embree alone, over packets that were made before
  double pass_seconds = 0.0;  ///< from subpixels to hits: ray set-up, checks, Embree
};

/// Traces the centre ray of every subpixel once each way, by turns. `threads` 0 = all cores. Times
/// are what the threads spend, over their number.
[[nodiscard]] VisibilityTiming time_visibility(const Scene& scene,
                                               const optics::OpticalModel& model, int threads);

}  // namespace lenticule::render
