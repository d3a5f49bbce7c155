// SPDX-License-Identifier: Apache-2.0
// CameraRays is the geometry of the simulated camera: the direction of the light of each picture
// point.
#pragma once

#include <optional>

#include "calib/simulation/simulated_camera.h"
#include "optics/vec.h"

namespace lenticule::calib {

class CameraRays {
 public:
  explicit CameraRays(const SimulatedCamera& camera);

  /// Returns the unit direction from the middle of the pupil toward the object at a picture point.
  [[nodiscard]] Vec3 direction(Vec2 picture) const;
  /// Returns the picture point of a point in space; nothing behind the camera.
  [[nodiscard]] std::optional<Vec2> project(Vec3 point) const;
  [[nodiscard]] Vec3 position() const { return position_; }
  /// Returns a point of the pupil, x and y in [-1, 1].
  [[nodiscard]] Vec3 pupil_point(double x, double y) const {
    return position_ + (right_ * x + down_ * y) * pupil_radius_mm_;
  }
  /// Returns the cosine of the angle between a direction and the camera's axis.
  [[nodiscard]] double cosine(Vec3 direction) const { return dot(direction, forward_); }

 private:
  [[nodiscard]] double stretch(double radius_squared) const {
    return 1.0 + radius_squared * (k1_ + radius_squared * k2_);
  }

  Vec3 position_;
  Vec3 forward_;
  Vec3 right_;
  Vec3 down_;
  double focal_px_;
  Vec2 centre_px_;
  double k1_;
  double k2_;
  double pupil_radius_mm_;
};

}  // namespace lenticule::calib
