// SPDX-License-Identifier: Apache-2.0
// Provides a calibration with a value in every member, as a fit returns it.
#pragma once

#include <cmath>
#include <limits>
#include <string>

#include "calib/calibration.h"
#include "calib/report/report.h"

namespace lenticule::test {

inline optics::Rig sample_rig() {
  optics::Rig rig;
  rig.name = "desk";
  rig.panel = {.width_px = 3840,
               .height_px = 2160,
               .pixel_width = Millimetres(0.15565),
               .pixel_height = Millimetres(0.15565),
               .layout = {}};
  rig.sheet.pitch = Subpixels(7.70123);
  rig.sheet.slant = 0.2521;
  rig.sheet.offset = Lenses(0.31);
  rig.sheet.gap = Millimetres(2.2);
  rig.sheet.refraction_shape = 0.45;
  rig.sheet.residual = {.columns = 4, .rows = 3, .lenses = {}};
  for (int i = 0; i < 12; ++i) rig.sheet.residual.lenses.push_back(0.02 * std::sin(i));
  rig.viewing.distance = Millimetres(700.0);
  rig.identity = {.manufacturer = "HKC",
                  .product = 10019,
                  .serial = "0000000000001",
                  .edid_sha256 = std::string(64, 'a')};
  return rig;
}

inline calib::PanelField sample_field(int columns, int rows) {
  calib::PanelField field{columns, rows, {}};
  for (int i = 0; i < columns * rows; ++i) field.values.push_back(0.004 * std::sin(0.05 * i));
  field.values[0] = std::numeric_limits<double>::quiet_NaN();
  return field;
}

inline calib::Viewpoint sample_viewpoint(const std::string& name, double x_mm, bool held_out) {
  calib::Viewpoint v;
  v.name = name;
  v.eye_mm = {x_mm, 20.0, 700.0};
  v.eye_sigma_mm = {0.4, 0.4, 0.7};
  v.tilt_degrees = 2.5;
  v.effective_pitch_subpx = {7.7254326, 1.3e-6};
  v.slant = {0.2521003, 2.1e-6};
  v.effective_offset_lenses = {0.1234, 0.0006};
  v.contrast = 0.61;
  v.covered = 0.97;
  v.blocks = 2040;
  v.rms_lenses = 0.0031;
  v.max_lenses = held_out ? 0.031 : 0.0117;
  v.reprojection_rms_px = 0.21;
  v.held_out = held_out;
  v.residual = sample_field(60, 34);
  return v;
}

inline calib::Calibration sample_calibration() {
  calib::Calibration c;
  c.rig = sample_rig();
  c.verdict = calib::Verdict::Intrinsic;
  c.parameters = {{"pitch_subpx", "subpixels", {7.7012301, 4.2e-6}},
                  {"slant", "px/px", {0.2521003, 2.1e-6}},
                  {"offset_lenses", "lenses", {0.3101, 0.0041}},
                  {"gap_mm", "mm", {2.203, 0.011}}};
  c.correlations = {{1.0, 0.02, -0.31, -0.83},
                    {0.02, 1.0, 0.11, 0.05},
                    {-0.31, 0.11, 1.0, 0.44},
                    {-0.83, 0.05, 0.44, 1.0}};
  c.viewpoints = {sample_viewpoint("centre", 0.0, false), sample_viewpoint("left", -240.0, false),
                  sample_viewpoint("right", 250.0, false), sample_viewpoint("near", 10.0, true)};
  c.camera = {1402.3, 961.2, 538.7, -0.031, 0.004};
  calib::LensSpot spot;
  for (int bin = 0; bin < 16; ++bin) {
    const double place = (bin + 0.5) / 16.0 - 0.5;
    spot.profile.push_back(std::exp(-place * place / (2 * 0.09 * 0.09)) / 3.6);
  }
  spot.sigma_lenses = 0.09;
  spot.two_view_crosstalk = 0.062;
  spot.veiling_glare = 0.013;
  c.spot = spot;
  c.link.chroma_leak = 0.011;
  c.drift = {0.0123, 3840.0, 0.0, {250.0, 20.0, 700.0}};
  c.seconds_computing = 2.4;
  return c;
}

inline calib::RecordDetails sample_details() {
  calib::RecordDetails details;
  details.when = std::chrono::system_clock::from_time_t(1772368496);  // 2026-03-01T12:34:56Z
  details.method = "camera";
  details.camera.name = "Webcam";
  details.camera.identity = "usb-0000:00:14.0-3";
  details.camera.width = 1920;
  details.camera.height = 1080;
  details.camera.channels = 3;
  details.camera.frames_per_second = 30.0;
  details.camera.pixel_format = "YUYV";
  details.camera.unlocked = {"no manual focus"};
  details.temperature_celsius = 24.5;
  return details;
}

}  // namespace lenticule::test
