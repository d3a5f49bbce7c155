// SPDX-License-Identifier: Apache-2.0
// Imports what refers to nodes by their names: key frames, lights and cameras.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "base/error.h"
#include "render/loaders/assimp/parts.h"
#include "render/loaders/limits.h"
#include "render/loaders/viewer_choices.h"
#include "render/scene/stage.h"

namespace lenticule::render {
// ---- animation

namespace {

constexpr double kTicksPerSecondUnlessStated = 25.0;
constexpr double kLongestSeconds = 1e7;

Vec3 value_of(const aiVectorKey& key) {
  return vec3(key.mValue);
}
std::array<double, 4> value_of(const aiQuatKey& key) {
  return {key.mValue.x, key.mValue.y, key.mValue.z, key.mValue.w};
}

bool finite(Vec3 v) {
  return is_finite(v);
}
bool finite(const std::array<double, 4>& q) {
  return std::all_of(q.begin(), q.end(), [](double v) { return std::isfinite(v); });
}

class AnimationImport {
 public:
  AnimationImport(const aiAnimation& from, SceneDescription& scene) : scene_(scene) {
    if (std::isfinite(from.mTicksPerSecond) && from.mTicksPerSecond > 0.0)
      ticks_per_second_ = from.mTicksPerSecond;
  }

  void add(const aiNodeAnim& from, Node& node) {
    read(std::span(from.mPositionKeys, from.mNumPositionKeys), node, node.translations);
    read(std::span(from.mRotationKeys, from.mNumRotationKeys), node, node.rotations);
    read(std::span(from.mScalingKeys, from.mNumScalingKeys), node, node.scales);
    node.animated = !node.translations.times.empty() || !node.rotations.times.empty() ||
                    !node.scales.times.empty();
  }

  void finish() {
    if (dropped_keys_ > 0)
      scene_.notes.push_back(fmt::format("{} key frames out of order dropped", dropped_keys_));
  }

 private:
  template <class Key, class T>
  void read(std::span<Key> keys, const Node& node, Channel<T>& channel) {
    if ((keys_ += keys.size()) > kMaxKeys)
      throw Error(ErrorKind::Input,
                  fmt::format("{}: more than {} key frames", scene_.source, kMaxKeys));
    for (const Key& key : keys) {
      const double seconds = key.mTime / ticks_per_second_;
      const T value = value_of(key);
      if (!(std::abs(seconds) <= kLongestSeconds) || !finite(value))
        throw Error(ErrorKind::Input,
                    fmt::format("{}: node '{}' has a key frame that is not finite", scene_.source,
                                node.name));
      if (!channel.times.empty() && seconds <= channel.times.back()) {
        ++dropped_keys_;
        continue;
      }
      channel.times.push_back(seconds);
      channel.values.push_back(value);
      scene_.duration_seconds = std::max(scene_.duration_seconds, seconds);
    }
  }

  SceneDescription& scene_;
  double ticks_per_second_ = kTicksPerSecondUnlessStated;
  size_t keys_ = 0;
  size_t dropped_keys_ = 0;
};

}  // namespace

void import_animation(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  if (from.mNumAnimations == 0) return;
  if (from.mNumAnimations > 1)
    scene.notes.push_back(
        fmt::format("{} animations; only the first is used", from.mNumAnimations));
  const aiAnimation& animation = *from.mAnimations[0];
  AnimationImport import(animation, scene);
  for (const aiNodeAnim* channel : std::span(animation.mChannels, animation.mNumChannels)) {
    const auto node = nodes.find(channel->mNodeName.C_Str());
    if (node != nodes.end()) import.add(*channel, scene.nodes[static_cast<size_t>(node->second)]);
  }
  import.finish();
}

// ---- lights

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

// ---- cameras

namespace {

/// Returns the vertical angle; assimp states the horizontal angle.
double vertical_fov_degrees(const aiCamera& from) {
  const double aspect = from.mAspect > 0.0F ? from.mAspect : 1.0;
  const double vertical = 2.0 * std::atan(std::tan(from.mHorizontalFOV / 2.0) / aspect);
  return vertical * 180.0 / std::numbers::pi;
}

/// Converts a camera; it looks at a point at distance 1 until focus() moves that point.
Camera camera_of(const aiCamera& from) {
  Camera camera;
  camera.name = from.mName.C_Str();
  camera.from = vec3(from.mPosition);
  camera.at = camera.from + normalized(vec3(from.mLookAt));
  camera.up = vec3(from.mUp);
  camera.vertical_fov_degrees = vertical_fov_degrees(from);
  camera.hither = std::isfinite(from.mClipPlaneNear) ? std::max(0.0F, from.mClipPlaneNear) : 0.0F;
  return camera;
}

}  // namespace

void import_cameras(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  if (from.mNumCameras == 0) return;
  const Bounds bounds = scene_bounds(scene);
  size_t unusable = 0;
  for (const aiCamera* camera : std::span(from.mCameras, from.mNumCameras)) {
    Camera to = camera_of(*camera);
    const auto node = nodes.find(to.name);
    to.node = node == nodes.end() ? -1 : node->second;
    if (!is_usable(to) || bounds.empty()) {
      ++unusable;
      continue;
    }
    if (camera->mOrthographicWidth > 0.0F && scene.cameras.empty())
      scene.notes.emplace_back("orthographic camera treated as a perspective one");
    focus(to, scene, bounds);
    scene.cameras.push_back(to);
  }
  if (unusable > 0) scene.notes.push_back(fmt::format("{} unusable cameras left out", unusable));
}

}  // namespace lenticule::render
