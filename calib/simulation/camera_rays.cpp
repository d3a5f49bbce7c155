// SPDX-License-Identifier: Apache-2.0
// Implements a pinhole camera with Brown's radial distortion.
#include "calib/simulation/camera_rays.h"

#include <cmath>
#include <numbers>

namespace lenticule::calib {

CameraRays::CameraRays(const SimulatedCamera& camera)
    : position_(camera.position_mm),
      forward_(normalized(camera.look_at_mm - camera.position_mm)),
      focal_px_(camera.focal_px),
      centre_px_{camera.centre_x_px, camera.centre_y_px},
      k1_(camera.k1),
      k2_(camera.k2),
      pupil_radius_mm_(camera.pupil_mm / 2.0) {
  const Vec3 level_right = normalized(cross(forward_, Vec3{0, 1, 0}));
  const Vec3 level_down = cross(forward_, level_right);
  const double roll = camera.roll_degrees * std::numbers::pi / 180.0;
  right_ = level_right * std::cos(roll) + level_down * std::sin(roll);
  down_ = level_down * std::cos(roll) - level_right * std::sin(roll);
}

Vec3 CameraRays::direction(Vec2 picture) const {
  const Vec2 seen = (picture - centre_px_) * (1.0 / focal_px_);
  const double seen_radius = std::hypot(seen.x, seen.y);
  double radius = seen_radius;
  // Newton steps solve r (1 + k1 r^2 + k2 r^4) = observed radius.
  for (int step = 0; step < 8; ++step) {
    const double squared = radius * radius;
    const double slope = 1.0 + squared * (3.0 * k1_ + 5.0 * k2_ * squared);
    const double miss = radius * stretch(squared) - seen_radius;
    radius -= miss / slope;
    if (std::abs(miss) < 1e-14) break;
  }
  const double undo = seen_radius > 0 ? radius / seen_radius : 1.0;
  return normalized(forward_ + right_ * (seen.x * undo) + down_ * (seen.y * undo));
}

std::optional<Vec2> CameraRays::project(Vec3 point) const {
  const Vec3 v = point - position_;
  const double depth = dot(v, forward_);
  if (!(depth > 0)) return std::nullopt;
  const Vec2 tangent{dot(v, right_) / depth, dot(v, down_) / depth};
  const double bent = stretch(tangent.x * tangent.x + tangent.y * tangent.y);
  return centre_px_ + tangent * (bent * focal_px_);
}

}  // namespace lenticule::calib
