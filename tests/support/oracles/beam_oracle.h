// SPDX-License-Identifier: Apache-2.0
// Reference implementation of a prefiltered subpixel, slow and simple: the mean of the scene's
// light over all rays between its lens and the eyes that see it there.
#pragma once

#include "render/rays/primary_rays.h"
#include "tests/support/oracles/reference_renderer.h"

namespace lenticule::test {

/// Returns the ray of a place in the beam of a subpixel. Bisection finds the eye on the viewing
/// line that sees the place at the apex line of the subpixel's lens; the ray to that eye then
/// starts beside the apex line.
[[nodiscard]] ReferenceLine beam_line(const optics::OpticalModel& model, int i, int j, int channel,
                                      const render::SubpixelPlace& place);

/// Returns the mean of the light along the rays of the places, as a code value, not rounded.
[[nodiscard]] double beam_mean(const render::SceneDescription& scene, const render::Stage& stage,
                               const optics::OpticalModel& model, int i, int j, int channel,
                               const std::vector<render::SubpixelPlace>& places, double start_mm);

/// Returns the middles of across * down * lens equal parts of a beam.
[[nodiscard]] std::vector<render::SubpixelPlace> beam_grid(int across, int down, int lens);

}  // namespace lenticule::test
