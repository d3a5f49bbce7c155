// SPDX-License-Identifier: Apache-2.0
// Imports cameras from assimp.
#include <assimp/version.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "render/loaders/assimp_parts.h"
#include "render/scene/camera_pose.h"
#include "render/scene/stage.h"

namespace lenticule::render {
namespace {

constexpr double kNarrowestDegrees = 1e-3;
constexpr double kWidestDegrees = 179.0;

enum class FileKind { Gltf, Other };

/// Returns the vertical angle. assimp states the horizontal angle; up to 5.2 its glTF reader
/// computed that by multiplying the file's vertical angle by the aspect ratio.
double vertical_fov_degrees(const aiCamera& from, FileKind kind) {
  const double aspect = from.mAspect > 0.0F ? from.mAspect : 1.0;
  const bool product =
      kind == FileKind::Gltf && aiGetVersionMajor() == 5 && aiGetVersionMinor() <= 2;
  const double vertical = product ? from.mHorizontalFOV / aspect
                                  : 2.0 * std::atan(std::tan(from.mHorizontalFOV / 2.0) / aspect);
  return vertical * 180.0 / std::numbers::pi;
}

/// Converts a camera; it looks at a point at distance 1 until focus() moves that point.
Camera camera_of(const aiCamera& from, FileKind kind) {
  Camera camera;
  camera.name = from.mName.C_Str();
  camera.from = vec3(from.mPosition);
  camera.at = camera.from + normalized(vec3(from.mLookAt));
  camera.up = vec3(from.mUp);
  if (kind == FileKind::Gltf) {
    // The format defines these; assimp up to 5.2 repeats the node's translation here.
    camera.from = {0, 0, 0};
    camera.at = {0, 0, -1};
    camera.up = {0, 1, 0};
  }
  camera.vertical_fov_degrees = vertical_fov_degrees(from, kind);
  camera.hither = std::isfinite(from.mClipPlaneNear) ? std::max(0.0F, from.mClipPlaneNear) : 0.0F;
  return camera;
}

bool usable(const Camera& camera) {
  const double fov = camera.vertical_fov_degrees;
  return is_finite(camera.from) && is_finite(camera.at) && is_finite(camera.up) &&
         !(camera.from == camera.at) && up_is_usable(camera) && fov >= kNarrowestDegrees &&
         fov <= kWidestDegrees;
}

/// Returns the camera as placed at time 0.
Camera placed(const Camera& camera, const SceneDescription& scene) {
  SceneDescription only;
  only.nodes = scene.nodes;
  only.cameras = {camera};
  return at_time(only, 0.0).cameras.front();
}

/// Moves `at` along the view to the depth of the scene's centre, where the panel will be.
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

}  // namespace

void import_cameras(const aiScene& from, const NodeNames& nodes, SceneDescription& scene) {
  if (from.mNumCameras == 0) return;
  const Bounds bounds = scene_bounds(scene);
  const FileKind kind = is_gltf(scene.source) ? FileKind::Gltf : FileKind::Other;
  size_t unusable = 0;
  for (const aiCamera* camera : std::span(from.mCameras, from.mNumCameras)) {
    Camera to = camera_of(*camera, kind);
    const auto node = nodes.find(to.name);
    to.node = node == nodes.end() ? -1 : node->second;
    if (!usable(to) || bounds.empty()) {
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
