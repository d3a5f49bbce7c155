// SPDX-License-Identifier: Apache-2.0
// The simulated camera: CameraRays is its geometry, Sensor turns the light on its pixels into the
// light that a program reads.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "calib/camera.h"
#include "lab/panel/simulated_setup.h"
#include "optics/vec.h"

namespace lenticule::lab {

// CameraRays is the geometry of the simulated camera: the direction of the light of each picture
// point.

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

// Simulates the JPEG compression of a camera. This is the simulation's sole wrapper of
// libjpeg-turbo.

/// Compresses (chroma at half width and height) and decompresses in place. `codes` are rows from
/// the top of 1 or 3 channels; quality 1 to 100. Returns false if the library fails.
[[nodiscard]] bool jpeg_round_trip(std::vector<uint8_t>& codes, int width, int height, int channels,
                                   int quality);

// Sensor simulates the conversion from the light on the sensor to the light that a program reads:
// noise, mosaic, curve, codes, JPEG.

class Sensor {
 public:
  Sensor(const SimulatedCamera& camera, uint64_t seed);

  /// Develops a picture: fills width, height, channels and light of `out`. `light` holds one value
  /// per pixel in the pixel's own colour, 1 = full scale, and is overwritten. `picture` selects the
  /// noise. Returns false if the picture could not be compressed.
  [[nodiscard]] bool develop(std::vector<float>& light, uint64_t picture, calib::CameraPicture& out,
                             int threads) const;

 private:
  void add_noise(int row, uint64_t picture, std::vector<float>& light) const;
  void demosaic_row(int row, const std::vector<float>& mosaic, calib::CameraPicture& out) const;
  void encode_row(int row, calib::CameraPicture& out) const;
  [[nodiscard]] bool pass_through_jpeg(calib::CameraPicture& out) const;
  void decode_row(int row, calib::CameraPicture& out) const;

  SimulatedCamera camera_;
  uint64_t seed_;
  std::vector<float> noise_;    // a table of Gaussian values
  std::vector<float> encoded_;  // code of each light
  std::vector<float> decoded_;  // light of each code, with the curve that the program assumes
};
}  // namespace lenticule::lab
