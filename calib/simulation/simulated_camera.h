// SPDX-License-Identifier: Apache-2.0
// SimulatedCamera describes the camera of the simulated bench: its position, lens, sensor and
// faults.
#pragma once

#include <array>

#include "optics/vec.h"

namespace lenticule::calib {

enum class CameraCurve { Linear, Srgb, Gamma };

/// Picture coordinates are pixels, (0, 0) the outer corner of the top-left pixel: the centre of
/// pixel (column, row) is (column + 1/2, row + 1/2).
struct SimulatedCamera {
  int width = 1920;
  int height = 1080;
  double focal_px = 1500.0;
  double centre_x_px = 960.0;
  double centre_y_px = 540.0;
  double k1 = 0.0;  ///< x_distorted = x (1 + k1 r^2 + k2 r^4), r of the undistorted tangents
  double k2 = 0.0;
  Vec3 position_mm{0, 0, 700};  ///< position of the pupil, panel frame
  Vec3 look_at_mm{0, 0, 0};
  double roll_degrees =
      0.0;  ///< rotation around the camera's axis, clockwise seen from behind the camera
  double pupil_mm = 2.0;      ///< diameter; the camera is focused on the sheet
  double psf_sigma_px = 0.6;  ///< blur, added to the pixel's own square

  int samples = 12;   ///< rays per pixel, 1 to 255
  bool bayer = true;  ///< RGGB, three channels; otherwise one channel that sees all colours
  /// response[camera colour][display colour]; a one-channel camera has their sum.
  std::array<std::array<double, 3>, 3> response{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

  double white_light = 0.7;   ///< light of the middle of a white panel, relative to full scale
  double ambient = 0.005;     ///< ambient light, relative to full scale
  bool vignetting = true;     ///< cos^4 of the angle to the axis
  double read_noise = 0.005;  ///< standard deviation of dark pixels, relative to full scale
  double shot_noise = 0.005;  ///< added at full scale; grows with the root of the light

  CameraCurve curve = CameraCurve::Srgb;
  double gamma = 2.2;  ///< code = light^(1/gamma), for CameraCurve::Gamma
  /// The curve that the program assumes and inverts.
  CameraCurve assumed_curve = CameraCurve::Srgb;
  bool eight_bits = true;  ///< otherwise the codes are not rounded
  int jpeg_quality = 0;    ///< 1 to 100, 4:2:0; 0 = uncompressed

  double frames_per_second = 30.0;
  double exposure_ms = 16.667;
  double rolling_shutter_ms = 0.0;  ///< delay from the first to the last row
  double gain_drift = 0.0;          ///< standard deviation of the gain from picture to picture
  double row_banding = 0.0;         ///< amplitude of gain waves down the rows
  double shake_mm = 0.0;  ///< standard deviation of the position from shown frame to shown frame

  /// A reflection that saturates: an ellipse, centre and half axes relative to the picture's width
  /// and height. Half axes of 0: no reflection.
  double highlight_x = 0.55;
  double highlight_y = 0.45;
  double highlight_half_width = 0.0;
  double highlight_half_height = 0.0;
};

/// Throws Error(Input) for an impossible camera.
void check_camera(const SimulatedCamera& camera);

}  // namespace lenticule::calib
