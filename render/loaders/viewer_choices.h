// SPDX-License-Identifier: Apache-2.0
// Completes what scene files leave to the viewer: the exposure, the points that cameras look at,
// and the Whitted materials that stand for metallic-roughness ones.
#pragma once

#include "render/scene/scene_description.h"
#include "render/scene/stage.h"

namespace lenticule::render {

/// Scales all lights by a common factor, light_scale, so that they light the centre of the scene
/// well. Files use candela, watts or arbitrary units, and leave the exposure to the viewer.
void expose(SceneDescription& scene);

/// Returns true if the numbers are finite and state a view.
[[nodiscard]] bool is_usable(const Camera& camera);

/// Moves `at` along the view to the depth of the middle of `bounds`, the bounds of the scene, where
/// the panel will be.
void focus(Camera& camera, const SceneDescription& scene, const Box& bounds);

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
