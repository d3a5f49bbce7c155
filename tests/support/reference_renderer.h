// SPDX-License-Identifier: Apache-2.0
// The renderer's oracle: a deliberately slow and simple ray tracer in double precision that follows
// the formulas of docs/rendering.md literally. Every ray is tested against every primitive. Only
// for tests; it shares no code with render/ beyond the scene description.
#pragma once

#include "optics/model.h"
#include "render/sampling/soft_light.h"
#include "render/scene_description.h"
#include "render/stage.h"

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

}  // namespace lenticule::testing
