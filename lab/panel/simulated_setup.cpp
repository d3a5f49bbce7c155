// SPDX-License-Identifier: Apache-2.0
// Checks that sheets, links and cameras are possible, and computes the chief ray of a sheet.
#include "lab/panel/simulated_setup.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"

namespace lenticule::lab {

namespace {

/// Throws unless `holds`; a comparison with NaN does not hold.
void require(bool holds, const char* object, const char* key, const char* range) {
  if (holds) return;
  throw Error(ErrorKind::Input, fmt::format("{}: {}: out of range", object, key),
              fmt::format("{} must be {}", key, range));
}

bool within(double value, double low, double high) {
  return value >= low && value <= high;
}

void check_lens(const SimulatedSheet& sheet, const optics::Panel& panel) {
  const char* object = "simulated sheet";
  require(within(sheet.pitch_subpx, 1.5, 3000.0), object, "pitch_subpx", "1.5 to 3000");
  require(within(sheet.slant, -4.0, 4.0), object, "slant", "-4 to 4");
  require(within(sheet.offset_lenses, -1e6, 1e6), object, "offset_lenses", "finite");
  const double pitch_mm = sheet.pitch_subpx / 3.0 * panel.pixel_width.value;
  require(within(sheet.radius_mm, 0.51 * pitch_mm, 1e6), object, "radius_mm",
          "more than half the lens pitch");
  require(within(sheet.thickness_mm, 1e-3, 1e3), object, "thickness_mm", "positive");
  for (const double index : sheet.index)
    require(within(index, 1.0, 4.0), object, "index", "1 to 4");
  require(within(sheet.air_gap_mm, 0.0, 1e3), object, "air_gap_mm", "0 or more");
}

void check_panel(const optics::Panel& panel) {
  const char* object = "simulated panel";
  require(within(panel.width_px, 1, 32768), object, "width_px", "1 to 32768");
  require(within(panel.height_px, 1, 32768), object, "height_px", "1 to 32768");
  // Subpixel numbers have 32 bits.
  require(double{1} * panel.width_px * panel.height_px <= 0x1p28, object, "width_px",
          "so that the panel has 2^28 pixels at most");
  require(within(panel.pixel_width.value, 1e-3, 100.0), object, "pixel_width", "positive");
  require(within(panel.pixel_height.value, 1e-3, 100.0), object, "pixel_height", "positive");
}

void check_light(const SimulatedCamera& camera) {
  const char* object = "simulated camera";
  require(within(camera.white_light, 0.0, 100.0), object, "white_light", "0 to 100");
  require(within(camera.ambient, 0.0, 100.0), object, "ambient", "0 to 100");
  require(within(camera.read_noise, 0.0, 1.0), object, "read_noise", "0 to 1");
  require(within(camera.shot_noise, 0.0, 1.0), object, "shot_noise", "0 to 1");
  require(within(camera.gain_drift, 0.0, 1.0), object, "gain_drift", "0 to 1");
  require(within(camera.row_banding, 0.0, 1.0), object, "row_banding", "0 to 1");
  require(within(camera.gamma, 0.1, 10.0), object, "gamma", "0.1 to 10");
  require(within(camera.jpeg_quality, 0, 100), object, "jpeg_quality", "0 to 100");
  for (const auto& row : camera.response) {
    for (const double part : row) require(within(part, 0.0, 100.0), object, "response", "0 to 100");
  }
  for (const double part : {camera.highlight_x, camera.highlight_y, camera.highlight_half_width,
                            camera.highlight_half_height}) {
    require(within(part, -10.0, 10.0), object, "highlight", "-10 to 10");
  }
}

void check_time(const SimulatedCamera& camera) {
  const char* object = "simulated camera";
  require(within(camera.frames_per_second, 0.1, 10000.0), object, "frames_per_second",
          "0.1 to 10000");
  require(within(camera.exposure_ms, 0.001, 10000.0), object, "exposure_ms", "positive");
  require(within(camera.rolling_shutter_ms, 0.0, 1000.0), object, "rolling_shutter_ms",
          "0 to 1000");
  require(within(camera.shake_mm, 0.0, 100.0), object, "shake_mm", "0 to 100");
}

}  // namespace

void check_link(const SimulatedPanelLink& link) {
  const char* object = "simulated link";
  require(within(link.eotf_exponent, 0.0, 10.0), object, "eotf_exponent", "0 to 10");
  require(within(link.refresh_hz, 0.1, 10000.0), object, "refresh_hz", "0.1 to 10000");
  require(within(link.response_ms, 0.0, 10000.0), object, "response_ms", "0 to 10000");
  require(within(link.scan_out_ms, 0.0, 10000.0), object, "scan_out_ms", "0 to 10000");
  require(within(link.pwm_hz, 0.0, 1e6), object, "pwm_hz", "0 to 1000000");
  require(within(link.pwm_duty, 0.01, 1.0), object, "pwm_duty", "0.01 to 1");
  for (const double part : {link.logo_left, link.logo_top, link.logo_width, link.logo_height})
    require(within(part, 0.0, 1.0), object, "logo", "0 to 1");
}

ChiefRay chief_ray(const SimulatedSheet& sheet, int channel) {
  if (sheet.lens_toward_panel) return {sheet.air_gap_mm, 1.0};
  const double n = sheet.index[static_cast<size_t>(channel)];
  const double first = sheet.thickness_mm / n + sheet.air_gap_mm;
  const double third = sheet.thickness_mm / (n * n * n) + sheet.air_gap_mm;
  return {first, third / first};
}

void check_sheet(const SimulatedSheet& sheet, const optics::Panel& panel) {
  const char* object = "simulated sheet";
  check_panel(panel);
  check_lens(sheet, panel);
  require(within(sheet.deformation_lenses, 0.0, 1.0), object, "deformation_lenses", "0 to 1");
  require(within(sheet.gap_bow, -0.5, 0.5), object, "gap_bow", "-0.5 to 0.5");
  const double width_mm = panel.width_px * panel.pixel_width.value;
  require(sheet.curve_radius_mm == 0.0 || within(sheet.curve_radius_mm, width_mm, 1e9), object,
          "curve_radius_mm", "0, or at least the panel's width");
  require(within(sheet.black_matrix, 0.0, 0.95), object, "black_matrix", "0 to 0.95");
  require(within(sheet.haze, 0.0, 1.0), object, "haze", "0 to 1");
  require(within(sheet.scratches, 0, 1000), object, "scratches", "0 to 1000");
  require(within(sheet.bubbles, 0.0, 0.3), object, "bubbles", "0 to 0.3");
}

void check_camera(const SimulatedCamera& camera) {
  const char* object = "simulated camera";
  require(within(camera.width, 2, 16384), object, "width", "2 to 16384");
  require(within(camera.height, 2, 16384), object, "height", "2 to 16384");
  require(within(camera.focal_px, 1.0, 1e6), object, "focal_px", "positive");
  require(within(camera.centre_x_px, -1e6, 1e6), object, "centre_x_px", "finite");
  require(within(camera.centre_y_px, -1e6, 1e6), object, "centre_y_px", "finite");
  require(within(camera.k1, -0.3, 0.3), object, "k1", "-0.3 to 0.3");
  require(within(camera.k2, -0.3, 0.3), object, "k2", "-0.3 to 0.3");
  require(is_finite(camera.position_mm) && camera.position_mm.z > 1.0, object, "position_mm",
          "in front of the panel");
  require(is_finite(camera.look_at_mm) && camera.look_at_mm.z < camera.position_mm.z, object,
          "look_at_mm", "nearer to the panel than the camera");
  require(std::isfinite(camera.roll_degrees), object, "roll_degrees", "finite");
  require(within(camera.pupil_mm, 0.0, 100.0), object, "pupil_mm", "0 to 100");
  require(within(camera.psf_sigma_px, 0.0, 100.0), object, "psf_sigma_px", "0 to 100");
  require(within(camera.samples, 1, 255), object, "samples", "1 to 255");
  check_light(camera);
  check_time(camera);
}
}  // namespace lenticule::lab
