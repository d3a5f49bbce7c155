// SPDX-License-Identifier: Apache-2.0
// What a subpixel ought to show, the slow and obvious way: the mean of the scene's light over all
// rays between its lens and the eyes that see it there.
#pragma once

#include "render/rays/footprint.h"
#include "tests/support/reference_renderer.h"

namespace lenticule::testing {

/// The ray of a place in the beam of a subpixel: the eye on the viewing line that sees the place in
/// the subpixel at the apex line of the subpixel's lens is found by bisection; then the ray to that
/// eye starts beside the apex line.
[[nodiscard]] ReferenceLine beam_line(const optics::OpticalModel& model, int i, int j, int channel,
                                      const render::SubpixelPlace& place);

/// The mean of the light along the rays of some places, as a code value, not rounded.
[[nodiscard]] double beam_mean(const render::SceneDescription& scene, const render::Stage& stage,
                               const optics::OpticalModel& model, int i, int j, int channel,
                               const std::vector<render::SubpixelPlace>& places, double start_mm);

/// The middles of across * down * lens equal parts of a beam.
[[nodiscard]] std::vector<render::SubpixelPlace> beam_grid(int across, int down, int lens);

}  // namespace lenticule::testing
