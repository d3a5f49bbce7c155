// SPDX-License-Identifier: Apache-2.0
// Whitted shading of one colour channel. docs/render/rendering.md states the formulas.
#pragma once

#include <optional>

#include "render/shading/surface.h"

namespace lenticule::render {

/// Arrival is the light that a light source sends to a point if unoccluded.
struct Arrival {
  Vec3 toward_light;       ///< unit
  double distance = 0.0;   ///< scene units; infinite for directional lights
  double intensity = 0.0;  ///< one channel; 0 outside a spot's cone
};
[[nodiscard]] Arrival arrival(const SceneLight& light, Vec3 point, double units_per_world,
                              int channel);

/// Returns the light that leaves the surface independent of the light sources: emission and
/// reflected ambient light.
[[nodiscard]] double own_light(const Surface& surface, Vec3 ambient, int channel);

/// Returns the share of an arriving light that leaves toward the viewer: Lambert's diffuse term
/// plus Phong's highlight. Zero if the light is behind the surface. `direction` is the viewing
/// ray's.
[[nodiscard]] double reflected_light(const Surface& surface, Vec3 direction, const Arrival& light);

/// Continuation holds the secondary rays of a viewing ray. A weight of zero means that there is no
/// ray.
struct Continuation {
  double mirror_weight = 0.0;
  Vec3 mirror_direction;
  double transmit_weight = 0.0;
  Vec3 transmit_direction;
};
[[nodiscard]] Continuation continuation(const Surface& surface, Vec3 direction);

/// Refracts by Snell's law at `normal`, which faces the ray's start; `eta` is the refraction index
/// on that side over the one on the other. Returns nothing for total internal reflection.
[[nodiscard]] std::optional<Vec3> refracted(Vec3 direction, Vec3 normal, double eta);

enum class Side { Viewer, Far };
/// Returns the start of rays that leave the surface.
[[nodiscard]] inline Vec3 spawn_point(const Surface& surface, Side side) {
  const double offset = side == Side::Viewer ? surface.spawn_offset : -surface.spawn_offset;
  return surface.point + surface.geometric_normal * offset;
}

}  // namespace lenticule::render
