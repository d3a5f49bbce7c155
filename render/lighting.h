// SPDX-License-Identifier: Apache-2.0
// What shines on a scene whose file leaves that open: the one place with these constants.
#pragma once

#include <cmath>
#include <vector>

#include "render/scene_description.h"

namespace lenticule::render {

/// The intensity of each of n equal lights, and of the ambient light, that makes scenes without
/// stated intensities neither too dark nor overexposed: sqrt(n) / (2 n). The rule that comes with
/// NFF.
[[nodiscard]] inline double nff_light_intensity(size_t lights) {
  const auto n = static_cast<double>(lights);
  return lights == 0 ? 0.0 : std::sqrt(n) / (2.0 * n);
}

/// Ambient light of colour-managed scenes that state none, in linear light.
inline constexpr double kDefaultAmbient = 0.12;

/// What is used for a scene without lights: one from the upper left behind the viewer's shoulder.
inline constexpr double kDefaultLightIntensity = 0.9;

[[nodiscard]] inline Vec3 ambient_light(const SceneDescription& description) {
  if (description.ambient) return *description.ambient;
  // A scene without any light is lit by one default light.
  const size_t lights = description.lights.empty() ? 1 : description.lights.size();
  const double a = description.colour_managed ? kDefaultAmbient : nff_light_intensity(lights);
  return {a, a, a};
}

}  // namespace lenticule::render
