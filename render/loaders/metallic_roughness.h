// SPDX-License-Identifier: Apache-2.0
// Approximates metallic-roughness materials by Whitted's model.
#pragma once

#include "render/scene/scene_description.h"

namespace lenticule::render {

struct MetallicRoughness {
  double metallic = 1.0;
  double roughness = 1.0;
  double transmission = 0.0;
  double ior = 1.5;
};

/// Sets the weights of the Whitted material. Light that a rough surface scatters widely is moved
/// from the mirror to the diffuse part, since that model has no blurred reflections.
void set_metallic_roughness(const MetallicRoughness& from, Material& to);

/// Converts opacity below 1 to transmittance without refraction.
void set_opacity(double opacity, Material& to);

}  // namespace lenticule::render
