// SPDX-License-Identifier: Apache-2.0
#include "calib/simulation/stress_cases.h"

#include <algorithm>

#include "calib/simulation/stress_trials.h"

namespace lenticule::calib {
namespace {

using D = StressDemand;

/// Largest unevenness that users do not see.
constexpr double kMostFlat = 0.02;

std::vector<StressCase> light_cases() {
  return {
      {"noise-1", 1, "1 % noise, eight bits", stress::noise_1, D::Good, {0.002, 0.02, 1e-6}},
      {"noise-5",
       2,
       "5 % noise, a quarter of the pixels",
       stress::noise_5,
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"low-resolution",
       3,
       "several lenses to a camera pixel",
       stress::low_resolution,
       D::Good,
       {0.02, 0.02, 3e-6}},
      {"gamma", 6, "camera gamma of 1.3 treated as 1", stress::gamma, D::Good, {0.002, 0.02, 1e-6}},
      {"gain-drift",
       7,
       "sRGB treated as linear, 3 % gain drift",
       stress::gain_drift,
       D::Good,
       {0.003, 0.02, 2e-6}},
      {"bands",
       8,
       "3 % rolling bands, 240 Hz backlight",
       stress::bands,
       D::Good,
       {0.02, 0.02, 1e-6}},
      {"distortion", 9, "a wide lens, k1 = -0.12", stress::distortion, D::Good, {0.02, 0.02, 1e-6}},
      {"oblique",
       10,
       "20 degrees to the side, 10 up",
       stress::oblique,
       D::Good,
       {0.02, 0.02, 1e-5}},
      {"highlight",
       14,
       "a reflection over 3 % of the panel",
       stress::highlight,
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"jpeg-50", 15, "JPEG of quality 50", stress::jpeg_50, D::Good, {0.02, 0.02, 3e-6}},
      {"shake",
       16,
       "a hand that shakes by 3 mm",
       stress::shake,
       D::GoodOrDetected,
       {0.02, 0.02, 1e-5}},
      {.name = "single-photo",
       .row = 21,
       .what = "one photograph of the chart",
       .trial = stress::single_photo,
       .limits = {0.02, 1.0, 2e-6},
       .single_photo = true},
  };
}

std::vector<StressCase> start_cases() {
  return {
      {"start-off",
       4,
       "start 10 % off in pitch, 0.05 in slant",
       stress::start_off,
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"alias-half", 5, "start at half the pitch", stress::alias_half, D::Good, {0.02, 0.02, 2e-6}},
      {"alias-double",
       5,
       "start at twice the pitch",
       stress::alias_double,
       D::Good,
       {0.02, 0.02, 2e-6}},
  };
}

std::vector<StressCase> panel_cases() {
  return {
      {"slow-panel",
       17,
       "20 ms response, 10 ms settling",
       stress::slow_panel,
       D::GoodOrDetected,
       {0.02, 0.02, 1e-5}},
      {"chroma-420", 18, "a link of 4:2:0", stress::chroma_420, D::Detected, {}, "4:2:0"},
      {"bgr", 18, "a panel of BGR", stress::bgr, D::Detected, {}, "BGR"},
      {"pentile", 18, "red and blue in turn", stress::pentile, D::Detected, {}, "layout"},
      {"curved", 23, "a panel bent by 1500 mm", stress::curved, D::Detected, {}, "curved"},
  };
}

std::vector<StressCase> sheet_cases() {
  return {
      {"deformed",
       11,
       "a sheet off by 0.1 lens",
       stress::deformed,
       D::Good,
       {0.02, 0.02, 1e-5, 0.005}},
      {"gap-bow",
       12,
       "a gap 5 % wider in the middle",
       stress::gap_bow,
       D::GoodOrDetected,
       {0.02, 0.02, 1e-5}},
      {"bubbles",
       13,
       "2 % bubbles, scratches, a logo",
       stress::bubbles,
       D::Good,
       {0.02, 0.02, 2e-6}},
      {.name = "vertical-6",
       .row = 19,
       .what = "pitch 6, vertical lenses",
       .trial = stress::vertical_6,
       .limits = {0.02, 0.02, 1e-6},
       .shortfall = "a lens has two green subpixels, always at the same phases: the phases between "
                    "them are not visible, so nothing can be measured"},
      {"third-6", 19, "pitch 6, slant 1/3", stress::third_6, D::Good, {0.02, 0.02, 1e-6}},
      {"wide-40", 20, "pitch 40", stress::wide_40, D::Good, {0.02, 0.02, 2e-6}},
      {"fine-4", 20, "pitch 4", stress::fine_4, D::GoodOrDetected, {0.02, 0.02, 2e-6}},
      {"warming",
       22,
       "0.2 K warmer at each viewpoint",
       stress::warming,
       D::Good,
       {0.02, 0.02, 2e-5}},
      {.name = "lens-in",
       .row = 24,
       .what = "lenses toward the panel, air between",
       .trial = stress::lens_in,
       .limits = {0.02, 0.02, 1e-5},
       .shortfall =
           "such lenses are asymmetric off axis, which the chief-ray model does not describe: "
           "viewpoints contradict each other by 0.05 lens, and the calibration is refused"},
  };
}

}  // namespace

const std::vector<StressCase>& stress_cases() {
  static const std::vector<StressCase> table = [] {
    std::vector<StressCase> all = light_cases();
    for (const auto& part : {start_cases(), panel_cases(), sheet_cases()})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }();
  return table;
}

StressLimits limits_at(const StressCase& one, StressSize size) {
  const Trial full = one.trial(StressSize::Full), here = one.trial(size);
  const double lenses = static_cast<double>(full.panel.width_px) / here.panel.width_px;
  const double columns = static_cast<double>(full.camera.width) / here.camera.width;
  StressLimits limits = one.limits;
  limits.pitch *= lenses * columns;
  limits.flat_lenses = std::min(kMostFlat, limits.flat_lenses * columns);
  limits.map_rms_lenses = std::min(1.0, limits.map_rms_lenses * columns);
  return limits;
}

}  // namespace lenticule::calib
