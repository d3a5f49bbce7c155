// SPDX-License-Identifier: Apache-2.0
// Checks that sheets, links and cameras are possible, and computes the chief ray of a sheet.
#include "lab/panel/simulated_setup.h"

#include <fmt/format.h>

#include <cmath>
#include <initializer_list>

#include "base/error.h"

namespace lenticule::lab {

namespace {

struct Range {
  const char* key;
  double value;
  double least;
  double most;
};

/// Throws Error(Input) unless all values are within their ranges; NaN is within none.
void require(const char* object, std::initializer_list<Range> ranges) {
  for (const Range& range : ranges)
    if (!(range.value >= range.least && range.value <= range.most))
      throw Error(ErrorKind::Input,
                  fmt::format("{}: {} {}: out of range", object, range.key, range.value),
                  fmt::format("{} must be {:g} to {:g}", range.key, range.least, range.most));
}

}  // namespace

ChiefRay chief_ray(const SimulatedSheet& sheet, int channel) {
  const double gap = sheet.gap_mm, n = sheet.index[static_cast<size_t>(channel)];
  const double n_gap = sheet.gap_index;
  // Lenses that face the panel have only the gap behind them.
  const double t = sheet.lens_toward_panel ? 0.0 : sheet.thickness_mm;
  const double first = t / n + gap / n_gap;
  return {first, (t / (n * n * n) + gap / (n_gap * n_gap * n_gap)) / first};
}

void check_sheet(const SimulatedSheet& sheet, const optics::Panel& panel) {
  require("simulated panel", {{"width_px", double(panel.width_px), 1, 32768},
                              {"height_px", double(panel.height_px), 1, 32768},
                              // Subpixel numbers have 32 bits.
                              {"pixels", double{1} * panel.width_px * panel.height_px, 1, 0x1p28},
                              {"pixel_width", panel.pixel_width.value, 1e-3, 100},
                              {"pixel_height", panel.pixel_height.value, 1e-3, 100}});
  const double pitch_mm = sheet.pitch_subpx / 3.0 * panel.pixel_width.value;
  const double width_mm = panel.width_px * panel.pixel_width.value;
  require("simulated sheet",
          {{"pitch_subpx", sheet.pitch_subpx, 1.5, 3000},
           {"slant", sheet.slant, -4, 4},
           {"offset_lenses", sheet.offset_lenses, -1e6, 1e6},
           {"radius_mm", sheet.radius_mm, 0.51 * pitch_mm, 1e6},
           {"thickness_mm", sheet.thickness_mm, 1e-3, 1e3},
           {"index of red", sheet.index[0], 1, 4},
           {"index of green", sheet.index[1], 1, 4},
           {"index of blue", sheet.index[2], 1, 4},
           {"gap_mm", sheet.gap_mm, 0, 1e3},
           {"gap_index", sheet.gap_index, 1, 4},
           {"valley", sheet.valley, 0, 0.5},
           {"deformation_lenses", sheet.deformation_lenses, 0, 1},
           {"gap_bow", sheet.gap_bow, -0.5, 0.5},
           {"curve_radius_mm", sheet.curve_radius_mm == 0.0 ? 1e9 : sheet.curve_radius_mm, width_mm,
            1e9},
           {"black_matrix", sheet.black_matrix, 0, 0.95},
           {"haze", sheet.haze, 0, 1},
           {"scratches", double(sheet.scratches), 0, 1000},
           {"bubbles", sheet.bubbles, 0, 0.3}});
}

void check_link(const SimulatedPanelLink& link) {
  require("simulated link", {{"eotf_exponent", link.eotf_exponent, 0, 10},
                             {"refresh_hz", link.refresh_hz, 0.1, 1e4},
                             {"response_ms", link.response_ms, 0, 1e4},
                             {"scan_out_ms", link.scan_out_ms, 0, 1e4},
                             {"pwm_hz", link.pwm_hz, 0, 1e6},
                             {"pwm_duty", link.pwm_duty, 0.01, 1},
                             {"logo_left", link.logo_left, 0, 1},
                             {"logo_top", link.logo_top, 0, 1},
                             {"logo_width", link.logo_width, 0, 1},
                             {"logo_height", link.logo_height, 0, 1}});
}

void check_camera(const SimulatedCamera& camera) {
  const Vec3 at = camera.position_mm, to = camera.look_at_mm;
  require("simulated camera", {{"width", double(camera.width), 2, 16384},
                               {"height", double(camera.height), 2, 16384},
                               {"focal_px", camera.focal_px, 1, 1e6},
                               {"centre_x_px", camera.centre_x_px, -1e6, 1e6},
                               {"centre_y_px", camera.centre_y_px, -1e6, 1e6},
                               {"k1", camera.k1, -0.3, 0.3},
                               {"k2", camera.k2, -0.3, 0.3},
                               {"position_mm.x", at.x, -1e9, 1e9},
                               {"position_mm.y", at.y, -1e9, 1e9},
                               {"position_mm.z", at.z, 1, 1e9},
                               {"look_at_mm.x", to.x, -1e9, 1e9},
                               {"look_at_mm.y", to.y, -1e9, 1e9},
                               {"look_at_mm.z", to.z, -1e9, std::nextafter(at.z, 0.0)},
                               {"roll_degrees", camera.roll_degrees, -1e6, 1e6},
                               {"pupil_mm", camera.pupil_mm, 0, 100},
                               {"psf_sigma_px", camera.psf_sigma_px, 0, 100},
                               {"samples", double(camera.samples), 1, 255},
                               {"white_light", camera.white_light, 0, 100},
                               {"ambient", camera.ambient, 0, 100},
                               {"read_noise", camera.read_noise, 0, 1},
                               {"shot_noise", camera.shot_noise, 0, 1},
                               {"gain_drift", camera.gain_drift, 0, 1},
                               {"row_banding", camera.row_banding, 0, 1},
                               {"gamma", camera.gamma, 0.1, 10},
                               {"jpeg_quality", double(camera.jpeg_quality), 0, 100},
                               {"highlight_x", camera.highlight_x, -10, 10},
                               {"highlight_y", camera.highlight_y, -10, 10},
                               {"highlight_half_width", camera.highlight_half_width, -10, 10},
                               {"highlight_half_height", camera.highlight_half_height, -10, 10},
                               {"frames_per_second", camera.frames_per_second, 0.1, 1e4},
                               {"exposure_ms", camera.exposure_ms, 1e-3, 1e4},
                               {"rolling_shutter_ms", camera.rolling_shutter_ms, 0, 1e3},
                               {"shake_mm", camera.shake_mm, 0, 100}});
  for (const auto& row : camera.response)
    for (const double part : row) require("simulated camera", {{"response", part, 0, 100}});
}

}  // namespace lenticule::lab
