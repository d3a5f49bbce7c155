// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/exposure.h"

#include <algorithm>
#include <cmath>

#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

/// Total irradiance by all lights of a white surface at the scene's centre that faces each light.
constexpr double kMiddleIrradiance = 1.3;

/// Returns the scene's lights as placed at time 0.
std::vector<Light> placed_lights(const SceneDescription& scene) {
  SceneDescription lights_only;
  lights_only.nodes = scene.nodes;
  lights_only.lights = scene.lights;
  return at_time(lights_only, 0.0).lights;
}

double irradiance(const Light& light, Vec3 middle, double nearest) {
  const double strength = std::max({light.colour.x, light.colour.y, light.colour.z});
  if (!light.falls_off) return strength;
  // A light inside the scene must not count as infinitely near to the centre.
  const double distance = std::max(length(light.position - middle), nearest);
  return distance > 0.0 ? strength / (distance * distance) : 0.0;
}

}  // namespace

void expose(SceneDescription& scene) {
  const Bounds bounds = scene_bounds(scene);
  if (scene.lights.empty() || bounds.empty()) return;
  const Vec3 middle = bounds.low + (bounds.high - bounds.low) / 2.0;
  const double nearest = length(bounds.high - bounds.low) / 4.0;
  double sum = 0.0;
  for (const Light& light : placed_lights(scene)) sum += irradiance(light, middle, nearest);
  const double factor = kMiddleIrradiance / sum;
  if (!std::isfinite(factor) || factor <= 0.0) return;
  for (Light& light : scene.lights) light.colour = light.colour * factor;
  scene.light_scale = factor;
}

}  // namespace lenticule::render
