// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/metallic_roughness.h"

#include <algorithm>

namespace lenticule::render {

void set_metallic_roughness(const MetallicRoughness& from, Material& to) {
  constexpr double kShiniest = 1e5;
  constexpr double kDielectricReflectance = 0.04;
  const double smooth = 1.0 - from.roughness;
  const double mirror =
      from.metallic * smooth + (1.0 - from.metallic) * kDielectricReflectance * smooth;
  to.transmittance = (1.0 - from.metallic) * from.transmission;
  to.specular = mirror;
  to.diffuse = std::max(0.0, 1.0 - mirror - to.transmittance);
  // Phong exponent equivalent to a Beckmann lobe of this roughness.
  const double alpha = std::max(from.roughness * from.roughness, 1e-3);
  to.shine = std::clamp(2.0 / (alpha * alpha) - 2.0, 1.0, kShiniest);
  to.tinted_specular = from.metallic > 0.5;
  if (to.transmittance > 0.0) to.refraction_index = from.ior;
}

void set_opacity(double opacity, Material& to) {
  to.transmittance = std::max(to.transmittance, 1.0 - opacity);
  to.diffuse *= opacity;
}

}  // namespace lenticule::render
