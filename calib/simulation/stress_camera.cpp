// SPDX-License-Identifier: Apache-2.0
// Stress cases of the camera, its light, its position, and the starting values.
#include <cmath>

#include "calib/simulation/stress_trials.h"

namespace lenticule::calib::stress {
namespace {

/// Sets the standard deviation at white; half of the variance is the sensor's own and half the
/// light's.
void set_noise(double noise, SimulatedCamera& camera) {
  camera.read_noise = noise * std::sqrt(0.5);
  camera.shot_noise = noise * std::sqrt(0.5);
}

/// Changes the number of pixels but not the field of view.
void resize(int width, int height, SimulatedCamera& camera) {
  const double factor = static_cast<double>(width) / camera.width;
  camera.width = width;
  camera.height = height;
  camera.focal_px *= factor;
  camera.centre_x_px = width / 2.0;
  camera.centre_y_px = height / 2.0;
}

}  // namespace

Trial base(StressSize size) {
  if (size == StressSize::Small) return small_trial(960, 540);
  Trial trial = plain_trial(3840, 2160, 1920, 1080);
  set_noise(0.01, trial.camera);
  trial.single_too = false;
  return trial;
}

/// Returns a small trial. A camera without mosaic has a third of the values, and half the knots
/// need a quarter of the fitting time.
Trial small_trial(int panel_width, int panel_height) {
  Trial trial = plain_trial(panel_width, panel_height, 480, 270);
  set_noise(0.01, trial.camera);
  trial.single_too = false;
  trial.link_and_spot = false;
  trial.camera.bayer = false;
  trial.camera.samples = 8;
  trial.options.map_columns = 12;
  trial.options.map_rows = 7;
  return trial;
}

Trial noise_1(StressSize size) {
  return base(size);
}

Trial noise_5(StressSize size) {
  Trial trial = base(size);
  set_noise(0.05, trial.camera);
  if (size == StressSize::Full) resize(960, 540, trial.camera);
  return trial;
}

Trial low_resolution(StressSize size) {
  if (size == StressSize::Small) return small_trial(1440, 810);
  Trial trial = base(size);
  resize(640, 480, trial.camera);
  return trial;
}

Trial gamma(StressSize size) {
  Trial trial = base(size);
  trial.camera.curve = CameraCurve::Gamma;
  trial.camera.gamma = 1.3;
  trial.camera.assumed_curve = CameraCurve::Linear;
  return trial;
}

Trial gain_drift(StressSize size) {
  Trial trial = base(size);
  trial.camera.curve = CameraCurve::Srgb;
  trial.camera.assumed_curve = CameraCurve::Linear;
  trial.camera.gain_drift = 0.03;
  // A brightened dark level makes marks look wider, so they need more pixels.
  if (size == StressSize::Small) resize(640, 360, trial.camera);
  return trial;
}

/// Sets an exposure that is not a whole number of the backlight's periods.
Trial bands(StressSize size) {
  Trial trial = base(size);
  trial.camera.rolling_shutter_ms = 15.0;
  trial.camera.row_banding = 0.03;
  trial.camera.exposure_ms = 10.0;
  trial.link.pwm_hz = 240.0;
  return trial;
}

Trial distortion(StressSize size) {
  Trial trial = base(size);
  trial.camera.k1 = -0.12;
  trial.camera.k2 = 0.03;
  return trial;
}

/// Puts the camera beside the panel's middle and turns it away from the middle.
Trial oblique(StressSize size) {
  Trial trial = base(size);
  trial.viewpoints = {{"centre", {10, 20, 700}, {0, 0, 0}, 0.0},
                      {"left", {-250, 125, 690}, {20, -15, 0}, 2.0},
                      {"right", {265, -110, 720}, {-20, 10, 0}, -3.0}};
  return trial;
}

/// Adds a reflection on three hundredths of the panel, which fills 0.65 of the picture's width and
/// of its height.
Trial highlight(StressSize size) {
  Trial trial = base(size);
  trial.camera.highlight_x = 0.65;
  trial.camera.highlight_y = 0.36;
  trial.camera.highlight_half_width = 0.0635;
  trial.camera.highlight_half_height = 0.0635;
  return trial;
}

Trial jpeg_50(StressSize size) {
  Trial trial = base(size);
  trial.camera.jpeg_quality = 50;
  trial.camera.bayer = true;
  return trial;
}

/// Moves the camera a little for every pattern. Each of its positions is traced again, which takes
/// long, so there is only one viewpoint.
Trial shake(StressSize size) {
  Trial trial = base(size);
  trial.camera.shake_mm = 3.0;
  trial.camera.samples = 6;
  trial.viewpoints.resize(1);
  return trial;
}

/// Uses the full-size panel at both sizes, because the chart needs so many lenses and such large
/// tags.
Trial single_photo(StressSize size) {
  Trial trial = base(StressSize::Full);
  if (size == StressSize::Small) resize(960, 540, trial.camera);
  trial.viewpoints = {{"centre", {60, -25, 700}, {0, 0, 0}, 0.0}};
  // Within the 3 % by which the chart's fringes differ from the lenses.
  trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 1.004);
  trial.start.sheet.slant = trial.sheet.slant - 0.004;
  const ChiefRay ray = chief_ray(trial.sheet, 1);
  trial.start.sheet.gap = Millimetres(ray.gap_mm);
  trial.start.sheet.refraction_shape = ray.refraction_shape;
  return trial;
}

Trial start_off(StressSize size) {
  Trial trial = base(size);
  trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 1.1);
  trial.start.sheet.slant = trial.sheet.slant - 0.05;
  return trial;
}

Trial alias_half(StressSize size) {
  Trial trial = base(size);
  trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 0.5);
  return trial;
}

Trial alias_double(StressSize size) {
  Trial trial = base(size);
  trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 2.0);
  return trial;
}

}  // namespace lenticule::calib::stress
