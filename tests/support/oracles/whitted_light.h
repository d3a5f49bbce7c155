// SPDX-License-Identifier: Apache-2.0
// The light that a Whitted surface sends to the viewer, in double precision: the reference of
// render/shading/shading_kernel.h.
#pragma once

#include <cmath>

#include "render/scene/texture.h"
#include "render/shading/shading.h"

namespace lenticule::test {

/// Returns the light that leaves the surface independent of the light sources: emission and
/// reflected ambient light.
[[nodiscard]] inline double own_light(const render::Surface& surface, Vec3 ambient, int channel) {
  const render::Material& material = *surface.material;
  return render::component(material.emission, channel) +
         render::component(ambient, channel) * material.diffuse * surface.colour;
}

/// Returns the share of an arriving light that leaves toward the viewer: Lambert's diffuse term
/// plus Phong's highlight. Zero if the light is behind the surface. `direction` is the viewing
/// ray's.
[[nodiscard]] inline double reflected_light(const render::Surface& surface, Vec3 direction,
                                            const render::Arrival& light) {
  const Vec3 normal = surface.shading_normal, toward = light.toward_light;
  const double cosine = dot(normal, toward);
  if (!(cosine > 0.0) || !(dot(surface.geometric_normal, toward) > 0.0)) return 0.0;
  const render::Material& material = *surface.material;
  double reflectance = material.diffuse * surface.colour * cosine;
  // Cosine between the light's mirror direction and the viewer.
  const double along = dot(toward - normal * (2.0 * cosine), direction);
  if (material.specular > 0.0 && along > 0.0) {
    const double tint = material.tinted_specular ? surface.colour : 1.0;
    reflectance += material.specular * tint * std::pow(along, material.shine);
  }
  return light.intensity * reflectance;
}

}  // namespace lenticule::test
