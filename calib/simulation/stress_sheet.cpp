// SPDX-License-Identifier: Apache-2.0
// Stress cases of the link, the panel and the sheet.
#include <algorithm>
#include <cmath>

#include "calib/simulation/stress_trials.h"

namespace lenticule::calib::stress {
namespace {

/// Sets another pitch; the lenses keep the base's shape, so that nominal values are equally
/// accurate.
void set_pitch(double pitch_subpx, double slant, Trial& trial) {
  const double wider = pitch_subpx / trial.sheet.pitch_subpx;
  trial.sheet.pitch_subpx = pitch_subpx;
  trial.sheet.slant = slant;
  trial.sheet.radius_mm *= wider;
  trial.sheet.thickness_mm *= wider;
  trial.start.sheet.pitch = Subpixels(pitch_subpx * 1.02);
  trial.start.sheet.slant = slant - 0.01;
  trial.start.sheet.gap = Millimetres(trial.start.sheet.gap.value * wider);
}

/// Returns a trial with more pixels and all knots, for faults that noise would hide.
Trial finer_base(StressSize size) {
  Trial trial = size == StressSize::Small ? plain_trial(960, 540, 640, 360) : base(size);
  trial.single_too = false;
  trial.link_and_spot = size == StressSize::Full;
  trial.camera.bayer = size == StressSize::Full;
  return trial;
}

/// Keeps one viewpoint, which is enough to refuse.
Trial one_viewpoint(Trial trial) {
  trial.viewpoints.resize(1);
  return trial;
}

/// Thermal expansion of free acrylic on glass.
constexpr double kStretchPerKelvin = 7.3e-5;
/// Each new temperature has to be traced again, so the temperature does not change at every
/// pattern.
constexpr int kPatternsPerStretch = 20;
/// Approximate number of patterns of a viewpoint.
constexpr double kPatternsPerViewpoint = 80.0;

}  // namespace

/// Sets a settle time that would suffice only for a fast panel.
Trial slow_panel(StressSize size) {
  Trial trial = base(size);
  trial.link.response_ms = 20.0;
  trial.link.scan_out_ms = 12.0;
  trial.camera.rolling_shutter_ms = 15.0;
  trial.capture.settle = std::chrono::milliseconds(10);
  return trial;
}

Trial chroma_420(StressSize size) {
  Trial trial = one_viewpoint(base(size));
  trial.link.chroma = Chroma::HalfBoth;
  trial.link_and_spot = true;
  trial.camera.bayer = true;
  return trial;
}

Trial bgr(StressSize size) {
  Trial trial = one_viewpoint(base(size));
  trial.link.actual_layout = optics::SubpixelLayout::bgr();
  return trial;
}

/// Swaps red and blue from pixel to pixel.
Trial pentile(StressSize size) {
  Trial trial = one_viewpoint(base(size));
  const optics::SubpixelOffset left{1.0 / 6.0, 0.5}, middle{0.5, 0.5}, right{5.0 / 6.0, 0.5};
  trial.link.actual_layout =
      optics::SubpixelLayout::cells(2, 1, {{left, middle, right}, {right, middle, left}});
  return trial;
}

Trial curved(StressSize size) {
  Trial trial = finer_base(size);
  trial.sheet.curve_radius_mm = 1500.0;
  return trial;
}

Trial deformed(StressSize size) {
  Trial trial = finer_base(size);
  trial.sheet.deformation_lenses = 0.1;
  return trial;
}

Trial gap_bow(StressSize size) {
  Trial trial = base(size);
  trial.sheet.gap_bow = 0.05;
  return trial;
}

Trial bubbles(StressSize size) {
  Trial trial = base(size);
  trial.sheet.bubbles = 0.02;
  trial.sheet.scratches = 3;
  trial.link.logo_left = 0.75;
  trial.link.logo_top = 0.1;
  trial.link.logo_width = 0.15;
  trial.link.logo_height = 0.1;
  return trial;
}

/// Sets whole numbers of subpixels and rows: lenses and subpixels stay aligned over the whole
/// panel.
Trial vertical_6(StressSize size) {
  Trial trial = base(size);
  set_pitch(6.0, 0.0, trial);
  return trial;
}

Trial third_6(StressSize size) {
  Trial trial = base(size);
  set_pitch(6.0, 1.0 / 3.0, trial);
  return trial;
}

/// Sets a wider cone, because a sheet with proportionally thick wide lenses does not exist.
Trial wide_40(StressSize size) {
  Trial trial = size == StressSize::Small ? small_trial(1920, 1080) : base(size);
  set_pitch(40.0, trial.sheet.slant, trial);
  return trial;
}

Trial fine_4(StressSize size) {
  Trial trial = base(size);
  set_pitch(4.0, trial.sheet.slant, trial);
  return trial;
}

/// Warms the sheet by 0.2 kelvin while each viewpoint is measured.
Trial warming(StressSize size) {
  Trial trial = base(size);
  trial.before_pattern = [](SimulatedBench& bench, size_t, int pattern) {
    if (pattern % kPatternsPerStretch != 0) return;
    const double part = std::min(1.0, pattern / kPatternsPerViewpoint);
    bench.set_thermal_stretch(0.2 * kStretchPerKelvin * part);
  };
  return trial;
}

/// Puts the pixels at the focal length of a lens in air, R / (n - 1). In air rays keep the angle at
/// which eyes see them, which no such lens focuses far to the side; so the viewpoints are not
/// there.
Trial lens_in(StressSize size) {
  Trial trial = base(size);
  const double gap_mm = trial.start.sheet.gap.value / 0.9;
  trial.sheet.lens_toward_panel = true;
  trial.sheet.air_gap_mm = gap_mm;
  trial.sheet.radius_mm = gap_mm * 0.5;
  trial.sheet.thickness_mm *= 0.3;
  trial.viewpoints = {{"centre", {10, 20, 700}, {0, 0, 0}, 0.0},
                      {"left", {-110, 0, 690}, {0, 0, 0}, 1.0},
                      {"right", {120, 30, 720}, {0, 0, 0}, -1.0}};
  trial.options.zone_half_width_mm = 100.0;
  return trial;
}

}  // namespace lenticule::calib::stress
