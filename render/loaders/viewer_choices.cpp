// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/viewer_choices.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error_kinds.h"
#include "base/numbers.h"

namespace lenticule::render {
namespace {

/// Returns "the file has 1 'walk', 2 'run'".
std::string listed(const std::string& kind, const std::vector<std::string>& names) {
  constexpr size_t kMost = 16;
  if (names.empty()) return fmt::format("the file has no {}s", kind);
  std::string text = "the file has";
  for (size_t n = 0; n < std::min(names.size(), kMost); ++n)
    text += fmt::format("{} {}{}", n == 0 ? "" : ",", n + 1,
                        names[n].empty() ? "" : fmt::format(" '{}'", names[n]));
  if (names.size() > kMost) text += ", ...; 'lenticule scene show --json' lists them";
  return text;
}

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

constexpr double kNarrowestDegrees = 1e-3;
constexpr double kWidestDegrees = 179.0;

/// Returns the camera as placed at time 0.
Camera placed(const Camera& camera, const SceneDescription& scene) {
  SceneDescription only;
  only.nodes = scene.nodes;
  only.cameras = {camera};
  return at_time(only, 0.0).cameras.front();
}

}  // namespace

Selection select(const std::vector<std::string>& names, const std::string& wanted,
                 const std::string& kind, const std::string& source, int otherwise) {
  if (wanted.empty()) return {names, names.empty() ? Selection::kNone : otherwise};
  if (kind == "animation" && wanted == "none") return {names, Selection::kNone};
  if (kind == "animation" && wanted == "all") return {names, Selection::kAll};
  auto index = static_cast<size_t>(std::ranges::find(names, wanted) - names.begin());
  if (index == names.size()) index = number_from<size_t>(wanted).value_or(0) - 1;
  if (index < names.size()) return {names, static_cast<int>(index)};
  throw input_error("{}: no {} '{}'", source, kind, wanted).remedy(listed(kind, names));
}

void apply_choices(SceneDescription& scene, const ViewerChoices& wanted) {
  const std::vector<std::string>& animations = scene.animations.names;
  (void)select(scene.scenes.names, wanted.scene, "scene", scene.source, 0);
  (void)select(animations, wanted.animation, "animation", scene.source, 0);
  (void)select(scene.variants.names, wanted.variant, "variant", scene.source, 0);
  if (animations.size() > 1 && wanted.animation.empty())
    scene.notes.push_back(fmt::format("{} animations, the first is played", animations.size()));
  std::vector<std::string> cameras;
  for (const Camera& camera : scene.cameras) cameras.push_back(camera.name);
  scene.camera = std::max(select(cameras, wanted.camera, "camera", scene.source, 0).taken, 0);
}

void expose(SceneDescription& scene) {
  if (scene.lights.empty()) return;
  const Box bounds = scene_bounds(scene);
  if (bounds.empty()) return;
  const Vec3 middle = bounds.low + (bounds.high - bounds.low) / 2.0;
  const double nearest = length(bounds.high - bounds.low) / 4.0;
  double sum = 0.0;
  for (const Light& light : placed_lights(scene)) sum += irradiance(light, middle, nearest);
  const double factor = kMiddleIrradiance / sum;
  if (!std::isfinite(factor) || factor <= 0.0) return;
  for (Light& light : scene.lights) light.colour = light.colour * factor;
  scene.light_scale = factor;
}

bool is_usable(const Camera& camera) {
  const double fov = camera.vertical_fov_degrees;
  return is_finite(camera.from) && is_finite(camera.at) && is_finite(camera.up) &&
         !(camera.from == camera.at) && up_is_usable(camera) && fov >= kNarrowestDegrees &&
         fov <= kWidestDegrees;
}

void focus(Camera& camera, const SceneDescription& scene, const Box& bounds) {
  const Camera world = placed(camera, scene);
  const Vec3 step = world.at - world.from;  // one local unit of distance
  const Vec3 middle = bounds.low + (bounds.high - bounds.low) / 2.0;
  double distance = dot(middle - world.from, step) / dot(step, step);
  const double extent = length(bounds.high - bounds.low) / length(step);
  // A camera inside the scene, or turned away from it, still needs a point in front of it.
  if (!(distance > extent / 100.0)) distance = extent / 4.0;
  if (!std::isfinite(distance) || distance <= 0.0) return;
  camera.at = camera.from + (camera.at - camera.from) * distance;
}

PbrMaterial pbr_like(const Material& material) {
  PbrMaterial pbr;
  pbr.base_colour = material.colour;
  pbr.base_colour_texture.texture = material.texture;
  // Microfacets with about the highlight of this exponent.
  pbr.roughness = std::clamp(std::pow(2.0 / (std::max(material.shine, 0.0) + 2.0), 0.25), 0.0, 1.0);
  pbr.metallic = material.tinted_specular ? std::clamp(material.specular, 0.0, 1.0) : 0.0;
  pbr.specular = material.specular > 0.0 ? 1.0 : 0.0;
  pbr.emission = material.emission;
  pbr.transmission = std::clamp(material.transmittance, 0.0, 1.0);
  pbr.ior = material.refraction_index;
  pbr.thickness = material.refraction_index == 1.0 ? 0.0 : 1.0;
  pbr.double_sided = true;
  return pbr;
}

}  // namespace lenticule::render
