// SPDX-License-Identifier: Apache-2.0
// Imports cameras from assimp.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "render/loaders/assimp/parts.h"
#include "render/loaders/camera_focus.h"
#include "render/scene/stage.h"

namespace lenticule::render {
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
