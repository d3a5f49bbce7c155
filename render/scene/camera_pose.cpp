// SPDX-License-Identifier: Apache-2.0
#include "render/scene/camera_pose.h"

#include <cmath>

namespace lenticule::render {

Vec3 any_perpendicular(Vec3 v) {
  const Vec3 size{std::abs(v.x), std::abs(v.y), std::abs(v.z)};
  // The axis along which v is smallest is the farthest from parallel to v.
  Vec3 axis{0, 0, 1};
  if (size.y <= size.x && size.y <= size.z)
    axis = {0, 1, 0};
  else if (size.x <= size.y && size.x <= size.z)
    axis = {1, 0, 0};
  return normalized(cross(v, cross(axis, v)));
}

bool up_is_usable(const Camera& camera) {
  constexpr double kParallel = 1e-6;
  const Vec3 forward = normalized(camera.at - camera.from);
  return length(cross(forward, normalized(camera.up))) > kParallel;
}

}  // namespace lenticule::render
