// SPDX-License-Identifier: Apache-2.0
// What a user may ask of lamps that have a size and of light that comes from all around;
// docs/rendering.md, "Soft light", states the formulas.
#pragma once

namespace lenticule::render {

/// Rays are counted for each point that is shaded, in every generation of mirrored rays.
struct SoftLight {
  /// Toward each lamp that has a size; 0 = hard shadows.
  int shadow_samples = 0;
  /// Of point lights and spots, in millimetres on the glass; 0 leaves them hard.
  double lamp_radius_mm = 20.0;
  /// Of directional lights, seen from the scene, in degrees; 0 leaves them hard.
  double sun_radius_degrees = 1.5;
  /// Of the flat ambient light, which then reaches a point only where these rays meet nothing; 0 =
  /// everywhere.
  int occlusion_samples = 0;
  /// How far those rays look, in millimetres on the glass; may be infinite.
  double occlusion_distance_mm = 50.0;
  /// Toward the surroundings, whose light then takes the place of the flat ambient light; 0 = flat.
  int environment_samples = 0;

  [[nodiscard]] bool samples_ambient() const {
    return occlusion_samples > 0 || environment_samples > 0;
  }
  [[nodiscard]] bool any() const { return shadow_samples > 0 || samples_ambient(); }
};

/// Throws Error(Usage) for numbers that are negative, too large or not finite, and where both
/// occlusion and environment are asked for.
void validate(const SoftLight& soft);

}  // namespace lenticule::render
