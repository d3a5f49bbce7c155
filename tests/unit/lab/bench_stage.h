// SPDX-License-Identifier: Apache-2.0
// Provides small panels, quiet cameras and patterns for tests of the simulated bench.
#pragma once

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "frames/frame.h"
#include "frames/srgb.h"
#include "lab/panel/simulated_bench.h"
#include "optics/panel.h"

namespace lenticule::lab {

inline constexpr calib::Nanoseconds kLong = std::chrono::seconds(10);

/// Returns a panel of 160 mm x 90 mm.
inline optics::Panel small_panel(int width_px = 640, int height_px = 360) {
  optics::Panel panel;
  panel.width_px = width_px;
  panel.height_px = height_px;
  panel.pixel_width = Millimetres(160.0 / width_px);
  panel.pixel_height = Millimetres(90.0 / height_px);
  return panel;
}

/// Returns a sheet with the given viewing cone, focused on the pixels for light along the axis.
inline SimulatedSheet focused_sheet(const optics::Panel& panel, double pitch_subpx, double slant,
                                    double cone_degrees = 12.0) {
  SimulatedSheet sheet;
  sheet.pitch_subpx = pitch_subpx;
  sheet.slant = slant;
  const double across = pitch_subpx / 3.0 * panel.pixel_width.value / std::hypot(1.0, slant);
  const double half_cone = cone_degrees / 2.0 * std::numbers::pi / 180.0;
  const double gap = across / (2.0 * std::tan(half_cone));
  const double index = sheet.index[1];
  sheet.thickness_mm = index * gap;
  sheet.radius_mm = gap * (index - 1.0);
  return sheet;
}

/// Returns a linear camera without noise and rounding. The panel fills some 70 % of its width.
inline SimulatedCamera quiet_camera(int width = 640, int height = 480) {
  SimulatedCamera camera;
  camera.width = width;
  camera.height = height;
  camera.position_mm = {20.0, 15.0, 400.0};
  camera.focal_px = 0.7 * width / 160.0 * 400.0;
  camera.centre_x_px = width / 2.0;
  camera.centre_y_px = height / 2.0;
  camera.bayer = false;
  camera.ambient = 0.0;
  camera.vignetting = false;
  camera.read_noise = 0.0;
  camera.shot_noise = 0.0;
  camera.curve = CameraCurve::Linear;
  camera.assumed_curve = CameraCurve::Linear;
  camera.eight_bits = false;
  return camera;
}

inline frames::WovenFrame plain_frame(const optics::Panel& panel, uint8_t red, uint8_t green,
                                      uint8_t blue) {
  frames::WovenFrame frame({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  for (size_t i = 0; i < frame.bytes().size(); i += 3) {
    frame.bytes()[i] = red;
    frame.bytes()[i + 1] = green;
    frame.bytes()[i + 2] = blue;
  }
  return frame;
}

/// Returns cos(2 pi s / pitch + phase) in linear light, s = 3 ((X - W/2) + slant (Y - H/2)).
inline frames::WovenFrame fringe_frame(const optics::Panel& panel, double pitch_subpx, double slant,
                                       double phase_cycles) {
  frames::WovenFrame frame({panel.width_px, panel.height_px, frames::PixelFormat::Rgb8});
  for (int j = 0; j < panel.height_px; ++j) {
    for (int i = 0; i < panel.width_px; ++i) {
      for (int channel = 0; channel < 3; ++channel) {
        const Vec2 at = panel.subpixel_centre_px(i, j, channel);
        const double s =
            3.0 * ((at.x - panel.width_px / 2.0) + slant * (at.y - panel.height_px / 2.0));
        const double wave = std::cos(2.0 * std::numbers::pi * (s / pitch_subpx + phase_cycles));
        frame.row(j)[i * 3 + channel] = frames::code_from_linear(0.5 + 0.45 * wave);
      }
    }
  }
  return frame;
}

/// Shows a frame and returns the picture of the first exposure that covers only this frame.
inline calib::CameraPicture look(SimulatedBench& bench, const frames::WovenFrame& frame) {
  calib::CameraPicture picture;
  if (bench.sink().show(frame.view(), kLong) != frames::ShowResult::Shown) return {};
  for (int settle = 0; settle < 4; ++settle) {
    if (bench.camera().grab(picture, kLong) != calib::GrabStatus::Ready) return {};
  }
  return picture;
}

inline float light_at(const calib::CameraPicture& picture, int column, int row, int channel) {
  return picture.light[(static_cast<size_t>(row) * static_cast<size_t>(picture.width) +
                        static_cast<size_t>(column)) *
                           static_cast<size_t>(picture.channels) +
                       static_cast<size_t>(channel)];
}

}  // namespace lenticule::lab
