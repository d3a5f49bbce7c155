// SPDX-License-Identifier: Apache-2.0
// Imports lights from assimp.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "base/error.h"
#include "render/loaders/assimp/parts.h"
#include "render/loaders/limits.h"

namespace lenticule::render {
namespace {

double cosine(double angle) {
  constexpr double kWidest = std::numbers::pi / 2.0;
  return std::isfinite(angle) ? std::cos(std::clamp(angle, 0.0, kWidest)) : 0.0;
}

Light light_of(const aiLight& from) {
  Light light;
  light.kind = from.mType == aiLightSource_DIRECTIONAL ? Light::Kind::Directional
               : from.mType == aiLightSource_SPOT      ? Light::Kind::Spot
                                                       : Light::Kind::Point;
  light.position = vec3(from.mPosition);
  light.direction = normalized(vec3(from.mDirection));
  light.colour = colour_of(from.mColorDiffuse);
  light.falls_off = light.kind != Light::Kind::Directional && from.mAttenuationQuadratic > 0.0F;
  constexpr double kHalf = 0.5;  // the importers state full angles
  light.cos_inner = cosine(from.mAngleInnerCone * kHalf);
  light.cos_outer = std::min(cosine(from.mAngleOuterCone * kHalf), light.cos_inner);
  return light;
}

bool usable(const Light& light) {
  const double strength = light.colour.x + light.colour.y + light.colour.z;
  const bool aimed =
      light.kind == Light::Kind::Point || std::abs(length(light.direction) - 1.0) < 1e-6;
  return is_finite(light.colour) && strength > 0.0 && is_finite(light.position) && aimed;
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
    Light to = light_of(*light);
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

}  // namespace lenticule::render
