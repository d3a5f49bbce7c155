// SPDX-License-Identifier: Apache-2.0
// Whitted shading of one colour channel. docs/rendering.md states the formulas.
#pragma once

#include "render/shading/surface.h"

namespace lenticule::render {

/// What a light sends to a point if nothing is in between.
struct Arrival {
  Vec3 toward_light;       ///< unit
  double distance = 0.0;   ///< scene units; infinite for directional lights
  double intensity = 0.0;  ///< in one channel; 0 outside a spot's cone
};
[[nodiscard]] Arrival arrival(const SceneLight& light, Vec3 point, double units_per_world,
                              int channel);

/// Emission and ambient light that leave the surface, whatever the lights do.
[[nodiscard]] double own_light(const Surface& surface, Vec3 ambient, int channel);

/// The part of an arriving light that leaves toward the viewer: Lambert plus Phong's highlight.
/// Zero where the light is behind the surface. `direction` is the viewing ray's.
[[nodiscard]] double reflected_light(const Surface& surface, Vec3 direction, const Arrival& light);

/// Where a viewing ray goes on. A weight of zero means that there is nothing to trace.
struct Continuation {
  double mirror_weight = 0.0;
  Vec3 mirror_direction;
  double transmit_weight = 0.0;
  Vec3 transmit_direction;
};
[[nodiscard]] Continuation continuation(const Surface& surface, Vec3 direction);

enum class Side { Viewer, Far };
/// Where rays that leave the surface start.
[[nodiscard]] inline Vec3 spawn_point(const Surface& surface, Side side) {
  const double offset = side == Side::Viewer ? surface.spawn_offset : -surface.spawn_offset;
  return surface.point + surface.geometric_normal * offset;
}

}  // namespace lenticule::render
