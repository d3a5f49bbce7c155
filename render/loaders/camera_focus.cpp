// SPDX-License-Identifier: Apache-2.0
#include "render/loaders/camera_focus.h"

#include <cmath>

#include "render/scene/camera_pose.h"

namespace lenticule::render {
namespace {

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

bool is_usable(const Camera& camera) {
  const double fov = camera.vertical_fov_degrees;
  return is_finite(camera.from) && is_finite(camera.at) && is_finite(camera.up) &&
         !(camera.from == camera.at) && up_is_usable(camera) && fov >= kNarrowestDegrees &&
         fov <= kWidestDegrees;
}

void focus(Camera& camera, const SceneDescription& scene, const Bounds& bounds) {
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

}  // namespace lenticule::render
