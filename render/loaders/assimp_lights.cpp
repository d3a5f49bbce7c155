// SPDX-License-Identifier: Apache-2.0
// Imports lights from assimp and sets the exposure.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "base/error.h"
#include "render/loaders/assimp_parts.h"
#include "render/loaders/limits.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

/// Total irradiance by all lights of a white surface at the scene's centre that faces each light.
constexpr double kMiddleIrradiance = 1.3;

/// Returns the factor from the importer's cone angles to half angles: glTF states half angles, the
/// other importers full ones.
double half_angle_factor(const std::string& source) {
  return is_gltf(source) ? 1.0 : 0.5;
}

double cosine(double angle) {
  constexpr double kWidest = std::numbers::pi / 2.0;
  return std::isfinite(angle) ? std::cos(std::clamp(angle, 0.0, kWidest)) : 0.0;
}

Light light_of(const aiLight& from, const std::string& source) {
  Light light;
  light.kind = from.mType == aiLightSource_DIRECTIONAL ? Light::Kind::Directional
               : from.mType == aiLightSource_SPOT      ? Light::Kind::Spot
                                                       : Light::Kind::Point;
  light.position = vec3(from.mPosition);
  light.direction = normalized(vec3(from.mDirection));
  light.colour = colour_of(from.mColorDiffuse);
  light.falls_off = light.kind != Light::Kind::Directional && from.mAttenuationQuadratic > 0.0F;
  const double factor = half_angle_factor(source);
  light.cos_inner = cosine(from.mAngleInnerCone * factor);
  light.cos_outer = std::min(cosine(from.mAngleOuterCone * factor), light.cos_inner);
  return light;
}

bool usable(const Light& light) {
  const double strength = light.colour.x + light.colour.y + light.colour.z;
  const bool aimed =
      light.kind == Light::Kind::Point || std::abs(length(light.direction) - 1.0) < 1e-6;
  return is_finite(light.colour) && strength > 0.0 && is_finite(light.position) && aimed;
}

/// Returns the scene's lights as placed at time 0.
std::vector<Light> placed_lights(const SceneDescription& scene) {
  SceneDescription lamps;
  lamps.nodes = scene.nodes;
  lamps.lights = scene.lights;
  return at_time(lamps, 0.0).lights;
}

double irradiance(const Light& light, Vec3 middle, double nearest) {
  const double strength = std::max({light.colour.x, light.colour.y, light.colour.z});
  if (!light.falls_off) return strength;
  // A lamp inside the scene must not count as infinitely near to the centre.
  const double distance = std::max(length(light.position - middle), nearest);
  return distance > 0.0 ? strength / (distance * distance) : 0.0;
}

}  // namespace

void import_lights(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  size_t unusable = 0;
  for (const aiLight* light : std::span(from.mLights, from.mNumLights)) {
    if (light->mType == aiLightSource_AMBIENT) {
      scene.ambient = scene.ambient.value_or(Vec3{}) + colour_of(light->mColorAmbient);
      continue;
    }
    if (scene.lights.size() == kMaxLights)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: more than {} lights", scene.source, kMaxLights));
    Light to = light_of(*light, scene.source);
    if (!usable(to)) {
      ++unusable;
      continue;
    }
    const auto node = nodes.find(light->mName.C_Str());
    to.node = node == nodes.end() ? -1 : node->second;
    scene.lights.push_back(to);
  }
  if (unusable > 0) scene.notes.push_back(fmt::format("{} unusable lights left out", unusable));
  if (scene.ambient && !is_finite(*scene.ambient)) scene.ambient.reset();
}

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
}

}  // namespace lenticule::render
