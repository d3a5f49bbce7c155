// SPDX-License-Identifier: Apache-2.0
// Reference implementation of the renderer: a deliberately slow and simple ray tracer in double
// precision that follows the formulas of docs/render/rendering.md literally. Every ray is tested
// against every primitive. Only for tests; it shares no code with render/ beyond the scene
// description.
#pragma once

#include <cstdint>

#include "optics/model.h"
#include "render/options/render_options.h"
#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::test {

struct ReferenceOptions {
  int max_depth = 5;
  /// Displacement of the ray: in the panel's plane, in millimetres, and in its tangents. Used to
  /// show that a subpixel lies on an edge.
  double move_x_mm = 0.0;
  double move_y_mm = 0.0;
  double move_tan = 0.0;
  /// Starts rays at the stage's near plane instead of the eye: a room has a wall behind its camera.
  bool from_near_plane = false;
  /// Area lights and light from the hemisphere; the environment is the flat background.
  render::SoftLight soft{};
};

/// Returns the code value of one subpixel, 0 ... 255 but not rounded. The scene must have no nodes.
[[nodiscard]] double reference_subpixel(const render::SceneDescription& scene,
                                        const render::Stage& stage,
                                        const optics::OpticalModel& model, int i, int j,
                                        int channel, const ReferenceOptions& options = {});

/// A line through (x_mm, y_mm, 0) in direction (tan_x, tan_y, 1) of the panel frame, from
/// `start_mm` on. Its light in one channel is linear in colour-managed scenes, else a share of the
/// largest code.
struct ReferenceLine {
  double x_mm = 0.0, y_mm = 0.0;
  double tan_x = 0.0, tan_y = 0.0;
};
[[nodiscard]] double reference_light(const render::SceneDescription& scene,
                                     const render::Stage& stage, const ReferenceLine& line,
                                     double start_mm, int channel,
                                     const ReferenceOptions& options = {}, uint32_t seed = 0);

/// Returns the code value of such light, not rounded.
[[nodiscard]] double reference_code(double light, bool colour_managed);

}  // namespace lenticule::test
