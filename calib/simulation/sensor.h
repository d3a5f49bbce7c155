// SPDX-License-Identifier: Apache-2.0
// Sensor simulates the conversion from the light on the sensor to the light that a program reads:
// noise, mosaic, curve, codes, JPEG.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/camera.h"
#include "calib/simulation/simulated_camera.h"

namespace lenticule::calib {

class Sensor {
 public:
  Sensor(const SimulatedCamera& camera, uint64_t seed);

  /// Develops a picture: fills width, height, channels and light of `out`. `light` holds one value
  /// per pixel in the pixel's own colour, 1 = full scale, and is overwritten. `picture` selects the
  /// noise. Returns false if the picture could not be compressed.
  [[nodiscard]] bool develop(std::vector<float>& light, uint64_t picture, CameraPicture& out,
                             int threads) const;

 private:
  void add_noise(int row, uint64_t picture, std::vector<float>& light) const;
  void demosaic_row(int row, const std::vector<float>& mosaic, CameraPicture& out) const;
  void encode_row(int row, CameraPicture& out) const;
  [[nodiscard]] bool pass_through_jpeg(CameraPicture& out) const;
  void decode_row(int row, CameraPicture& out) const;

  SimulatedCamera camera_;
  uint64_t seed_;
  std::vector<float> noise_;    // a table of Gaussian values
  std::vector<float> encoded_;  // code of each light
  std::vector<float> decoded_;  // light of each code, with the curve that the program assumes
};

}  // namespace lenticule::calib
