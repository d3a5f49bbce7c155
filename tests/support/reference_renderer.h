// SPDX-License-Identifier: Apache-2.0
// The renderer's oracle: a deliberately slow and simple ray tracer in double precision that follows
// the formulas of docs/rendering.md literally. Every ray is tested against every primitive. Only
// for tests; it shares no code with render/ beyond the scene description.
#pragma once

#include <cstdint>

#include "optics/model.h"
#include "render/options/soft_light.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::testing {

struct ReferenceOptions {
  int max_depth = 5;
  /// How far the ray is moved: across the glass, in millimetres, and in its tangents. Used to show
  /// that a subpixel lies on an edge.
  double move_x_mm = 0.0;
  double move_y_mm = 0.0;
  double move_tan = 0.0;
  /// Rays start where the stage's camera starts to see, not at the eye: a room has a wall behind
  /// its camera.
  bool from_near_plane = false;
  /// Lamps with a size and light from all around; the surroundings are the flat background.
  render::SoftLight soft{};
};

/// The code value, 0 ... 255 but not rounded, of one subpixel. The scene must have no nodes.
[[nodiscard]] double reference_subpixel(const render::SceneDescription& scene,
                                        const render::Stage& stage,
                                        const optics::OpticalModel& model, int i, int j,
                                        int channel, const ReferenceOptions& options = {});

/// The light of one channel that comes along the line through (x_mm, y_mm, 0) in direction (tan_x,
/// tan_y, 1) of the panel frame, from `start_mm` on: linear in colour-managed scenes, else parts of
/// the largest code.
struct ReferenceLine {
  double x_mm = 0.0, y_mm = 0.0;
  double tan_x = 0.0, tan_y = 0.0;
};
[[nodiscard]] double reference_light(const render::SceneDescription& scene,
                                     const render::Stage& stage, const ReferenceLine& line,
                                     double start_mm, int channel,
                                     const ReferenceOptions& options = {}, uint32_t seed = 0);

/// The code value of such light, not rounded.
[[nodiscard]] double reference_code(double light, bool colour_managed);

}  // namespace lenticule::testing
