// SPDX-License-Identifier: Apache-2.0
// User options for area lights and ambient light; docs/render/soft-light.md states the
// formulas.
#pragma once

namespace lenticule::render {

/// SoftLight holds ray counts and sizes of soft lighting. Ray counts are per shaded point, at every
/// bounce.
struct SoftLight {
  /// Rays toward each area light; 0 = hard shadows.
  int shadow_samples = 0;
  /// Radius of point and spot lights, in millimetres on the panel; 0 = hard shadows.
  double light_radius_mm = 20.0;
  /// Angular radius of directional lights, as seen from the scene, in degrees; 0 = hard shadows.
  double sun_radius_degrees = 1.5;
  /// Rays that sample the occlusion of the flat ambient light, which reaches a point only along
  /// rays that meet nothing; 0 = no occlusion.
  int occlusion_samples = 0;
  /// Length of the occlusion rays, in millimetres on the panel; may be infinite.
  double occlusion_distance_mm = 50.0;
  /// Rays toward the environment, whose light then replaces the flat ambient light; 0 = flat.
  int environment_samples = 0;

  [[nodiscard]] bool samples_ambient() const {
    return occlusion_samples > 0 || environment_samples > 0;
  }
  [[nodiscard]] bool any() const { return shadow_samples > 0 || samples_ambient(); }
};

/// Checks the options. Throws Error(Usage) for numbers that are negative, too large or not finite,
/// and if both occlusion and environment samples are requested.
void validate(const SoftLight& soft);

}  // namespace lenticule::render
