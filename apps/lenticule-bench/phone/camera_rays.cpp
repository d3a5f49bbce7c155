// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/phone/camera_rays.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lenticule::bench {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

}  // namespace

CameraRays::CameraRays(const Phone& phone, const Shot& shot)
    : phone_(phone), shot_(shot), longer_(std::max(phone.width, phone.height)) {
  focal_px_ = phone.focal * longer_ * (1.0 + shot.breathing);
  axis_px_ = {0.5 * phone.width + (phone.axis.x + shot.stabilisation.x) * longer_,
              0.5 * phone.height + (phone.axis.y + shot.stabilisation.y) * longer_};
  forward_ = normalized(Vec3(shot.look_at_mm.x, shot.look_at_mm.y, 0.0) - shot.eye_mm);
  const Vec3 right = normalized(cross(forward_, Vec3(0.0, 1.0, 0.0)));
  const Vec3 down = cross(forward_, right);
  const double c = std::cos(shot.roll_degrees * kDegree);
  const double s = std::sin(shot.roll_degrees * kDegree);
  right_ = c * right + s * down;
  down_ = c * down - s * right;
}

CameraRays::Ray CameraRays::ray(double u, double v) const {
  // Radius r of the tangent from its distorted value.
  const double x = (u - axis_px_.x) / focal_px_, y = (v - axis_px_.y) / focal_px_;
  const double distorted = std::hypot(x, y);
  double r = distorted;
  for (int k = 0; k < 6; ++k) {
    const double square = r * r;
    const double value =
        r * (1.0 + square * (phone_.radial1 + phone_.radial2 * square)) - distorted;
    r -= value / (1.0 + square * (3.0 * phone_.radial1 + 5.0 * phone_.radial2 * square));
  }
  const double part = distorted > 0.0 ? r / distorted : 1.0;
  Vec3 camera{x * part, y * part, 1.0};
  const double seconds = phone_.readout_s * (v / phone_.height - 0.5);
  camera += cross(shot_.turn_degrees_s * (kDegree * seconds), camera);
  return {shot_.eye_mm + shot_.drift_mm_s * seconds,
          right_ * camera.x + down_ * camera.y + forward_ * camera.z};
}

Vec2 CameraRays::about(Vec2 panel_mm) const {
  const Vec3 d = Vec3(panel_mm.x, panel_mm.y, 0.0) - shot_.eye_mm;
  const double z = std::max(dot(d, forward_), 1.0);
  return {axis_px_.x + focal_px_ * dot(d, right_) / z, axis_px_.y + focal_px_ * dot(d, down_) / z};
}

}  // namespace lenticule::bench
