// SPDX-License-Identifier: Apache-2.0
// CameraRays is the geometry of one photograph: pose, focal length, distortion, and the motion of
// the hand while the rows are read.
#pragma once

#include "apps/lenticule-bench/phone/phone_photo.h"

namespace lenticule::bench {

/// CameraRays returns the ray of each pixel of one photograph.
///
/// Lifetime: must not outlive phone and shot. Thread safety: any thread.
class CameraRays {
 public:
  CameraRays(const Phone& phone, const Shot& shot);

  /// Ray starts at the eye of the camera. Panel frame, mm.
  struct Ray {
    Vec3 eye;
    Vec3 direction;
  };
  /// Returns the ray of the point (u, v) of the sensor, pixels.
  [[nodiscard]] Ray ray(double u, double v) const;
  /// Returns the pixel at which a panel point appears, without distortion and motion.
  [[nodiscard]] Vec2 about(Vec2 panel_mm) const;

 private:
  const Phone& phone_;
  const Shot& shot_;
  double longer_, focal_px_ = 0.0;
  Vec2 axis_px_;
  Vec3 forward_, right_, down_;
};

}  // namespace lenticule::bench
