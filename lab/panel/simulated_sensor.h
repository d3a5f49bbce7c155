// SPDX-License-Identifier: Apache-2.0
// The simulated camera: CameraRays is its geometry, Sensor turns the light on its pixels into the
// light that a program reads.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
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
  /// Returns a vector whose components are along right, down and forward of the camera.
  [[nodiscard]] Vec3 from_camera(Vec3 v) const {
    return right_ * v.x + down_ * v.y + forward_ * v.z;
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

/// Returns the colour of a mosaic pixel (RGGB): 0 red, 1 green, 2 blue; green for a camera without
/// mosaic.
[[nodiscard]] inline int mosaic_colour(const SimulatedCamera& camera, int column, int row) {
  if (!camera.bayer) return 1;
  return (row & 1) + (column & 1);
}

/// Light of each code of each display channel in each colour of the camera.
using LightTable = std::array<std::array<std::array<float, 256>, 3>, 3>;
/// Returns the table with which the mean over the points of a white panel, of whose area the
/// fraction `lit_area` is lit, is the camera's white light in each colour.
[[nodiscard]] LightTable light_table(const SimulatedCamera& camera,
                                     const std::array<float, 256>& light_of_codes, double lit_area);

/// Interpolates the three colours of a row bilinearly. `mosaic` holds the light of `height` rows
/// of pixels in their own colours, beginning with a red one.
void demosaic_row(const std::vector<float>& mosaic, int width, int height, int row, float* rgb);

// Simulates the JPEG compression of a camera: chroma at half width and height. `codes` are rows
// from the top of 1 or 3 channels; quality 1 to 100. Both throw Error(Failed) if libjpeg-turbo
// fails.

[[nodiscard]] std::string compress_jpeg(const std::vector<uint8_t>& codes, int width, int height,
                                        int channels, int quality);
/// Compresses and decompresses in place.
void jpeg_round_trip(std::vector<uint8_t>& codes, int width, int height, int channels, int quality);

/// Returns 65,536 random numbers with mean 0 and standard deviation 1, for the noise of pixels.
[[nodiscard]] std::vector<float> gaussian_table(uint64_t seed);

// Sensor simulates the conversion from the light on the sensor to the light that a program reads:
// noise, mosaic, curve, codes, JPEG.

class Sensor {
 public:
  Sensor(const SimulatedCamera& camera, uint64_t seed);

  /// Develops a picture: fills width, height, channels and light of `out`. `light` holds one value
  /// per pixel in the pixel's own colour, 1 = full scale, and is overwritten. `picture` selects the
  /// noise.
  void develop(std::vector<float>& light, uint64_t picture, calib::CameraPicture& out,
               int threads) const;

 private:
  void add_noise(int row, uint64_t picture, std::vector<float>& light) const;
  void encode_row(int row, calib::CameraPicture& out) const;
  void pass_through_jpeg(calib::CameraPicture& out) const;
  void decode_row(int row, calib::CameraPicture& out) const;

  SimulatedCamera camera_;
  uint64_t seed_;
  std::vector<float> noise_;    // a table of Gaussian values
  std::vector<float> encoded_;  // code of each light
  std::vector<float> decoded_;  // light of each code, with the curve that the program assumes
};
}  // namespace lenticule::lab
