// SPDX-License-Identifier: Apache-2.0
// The table of stress cases, and the evaluation of a run.
#include "lab/panel/stress_cases.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/error.h"
#include "calib/photo/single_photo.h"
#include "optics/model.h"

namespace lenticule::lab {
namespace {

using calib::Verdict;

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

/// Returns the starting point of all trials: three viewpoints, a usual webcam, one picture per
/// pattern.
Trial base(bool full) {
  if (!full) return small_trial(960, 540);
  Trial trial = plain_trial(3840, 2160, 1920, 1080);
  set_noise(0.01, trial.camera);
  trial.single_too = false;
  return trial;
}

/// Returns a trial with more pixels and all knots, for faults that noise would hide.
Trial finer_base(bool full) {
  Trial trial = full ? base(full) : plain_trial(960, 540, 640, 360);
  trial.single_too = false;
  trial.link_and_spot = full;
  trial.camera.bayer = full;
  return trial;
}

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

/// Uses the full-size panel at both sizes, because the chart needs so many lenses and such large
/// tags.
void single_photo(Trial& trial, bool full) {
  trial = base(true);
  if (!full) resize(960, 540, trial.camera);
  trial.viewpoints = {{"centre", {60, -25, 700}, {0, 0, 0}, 0.0}};
  // Within the 3 % by which the chart's fringes differ from the lenses.
  trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 1.004);
  trial.start.sheet.slant = trial.sheet.slant - 0.004;
  const ChiefRay ray = chief_ray(trial.sheet, 1);
  trial.start.sheet.gap = Millimetres(ray.gap_mm);
  trial.start.sheet.refraction_shape = ray.refraction_shape;
}

/// Warms the sheet by 0.2 kelvin while each viewpoint is measured. Each new temperature has to be
/// traced again, so the temperature does not change at every pattern.
void warming(Trial& trial, bool) {
  trial.before_pattern = [](SimulatedBench& bench, size_t, int pattern) {
    constexpr double kStretchPerKelvin = 7.3e-5;  // free acrylic on glass
    constexpr int kPatternsPerStretch = 20;
    constexpr double kPatternsPerViewpoint = 80.0;  // about
    if (pattern % kPatternsPerStretch != 0) return;
    bench.set_thermal_stretch(0.2 * kStretchPerKelvin *
                              std::min(1.0, pattern / kPatternsPerViewpoint));
  };
}

/// Puts the pixels at the focal length of a lens in air, R / (n - 1). In air rays keep the angle at
/// which eyes see them, which no such lens focuses far to the side; so the viewpoints are not
/// there.
void lens_in(Trial& trial, bool) {
  const double gap_mm = trial.start.sheet.gap.value / 0.9;
  trial.sheet.lens_toward_panel = true;
  trial.sheet.gap_mm = gap_mm;
  trial.sheet.radius_mm = gap_mm * 0.5;
  trial.sheet.thickness_mm *= 0.3;
  trial.viewpoints = {{"centre", {10, 20, 700}, {0, 0, 0}, 0.0},
                      {"left", {-110, 0, 690}, {0, 0, 0}, 1.0},
                      {"right", {120, 30, 720}, {0, 0, 0}, -1.0}};
  trial.options.zone_half_width_mm = 100.0;
}

/// Largest unevenness that users do not see.
constexpr double kMostFlat = 0.02;

}  // namespace

const std::vector<StressCase>& stress_cases() {
  using D = StressDemand;
  // Limits are those of evenness, of the worst eye, of the pitch and of the map. One viewpoint is
  // enough to refuse.
  static const std::vector<StressCase> table = {
      {"noise-1", 1, "1 % noise, eight bits", [](Trial&, bool) {}, D::Good, {0.002, 0.02, 1e-6}},
      {"noise-5",
       2,
       "5 % noise, a quarter of the pixels",
       [](Trial& trial, bool full) {
         set_noise(0.05, trial.camera);
         if (full) resize(960, 540, trial.camera);
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"low-resolution",
       3,
       "several lenses to a camera pixel",
       [](Trial& trial, bool full) {
         if (full)
           resize(640, 480, trial.camera);
         else
           trial = small_trial(1440, 810);
       },
       D::Good,
       {0.02, 0.02, 3e-6}},
      {"gamma",
       6,
       "camera gamma of 1.3 treated as 1",
       [](Trial& trial, bool) {
         trial.camera.curve = CameraCurve::Gamma;
         trial.camera.gamma = 1.3;
         trial.camera.assumed_curve = CameraCurve::Linear;
       },
       D::Good,
       {0.002, 0.02, 1e-6}},
      {"gain-drift",
       7,
       "sRGB treated as linear, 3 % gain drift",
       [](Trial& trial, bool full) {
         trial.camera.curve = CameraCurve::Srgb;
         trial.camera.assumed_curve = CameraCurve::Linear;
         trial.camera.gain_drift = 0.03;
         // A brightened dark level makes marks look wider, so they need more pixels.
         if (!full) resize(640, 360, trial.camera);
       },
       D::Good,
       {0.003, 0.02, 2e-6}},
      {"bands",
       8,
       "3 % rolling bands, 240 Hz backlight",
       [](Trial& trial, bool) {
         trial.camera.rolling_shutter_ms = 15.0;
         trial.camera.row_banding = 0.03;
         trial.camera.exposure_ms = 10.0;  // no whole number of the backlight's periods
         trial.link.pwm_hz = 240.0;
       },
       D::Good,
       {0.02, 0.02, 1e-6}},
      {"distortion",
       9,
       "a wide lens, k1 = -0.12",
       [](Trial& trial, bool) {
         trial.camera.k1 = -0.12;
         trial.camera.k2 = 0.03;
       },
       D::Good,
       {0.02, 0.02, 1e-6}},
      {"oblique",
       10,
       "20 degrees to the side, 10 up",
       [](Trial& trial, bool) {
         // Beside the panel's middle, and turned away from the middle.
         trial.viewpoints = {{"centre", {10, 20, 700}, {0, 0, 0}, 0.0},
                             {"left", {-250, 125, 690}, {20, -15, 0}, 2.0},
                             {"right", {265, -110, 720}, {-20, 10, 0}, -3.0}};
       },
       D::Good,
       {0.02, 0.02, 1e-5}},
      {"highlight",
       14,
       "a reflection over 3 % of the panel",
       [](Trial& trial, bool) {
         // The panel fills 0.65 of the picture's width and of its height.
         trial.camera.highlight_x = 0.65;
         trial.camera.highlight_y = 0.36;
         trial.camera.highlight_half_width = trial.camera.highlight_half_height = 0.0635;
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"jpeg-50",
       15,
       "JPEG of quality 50",
       [](Trial& trial, bool) {
         trial.camera.jpeg_quality = 50;
         trial.camera.bayer = true;
       },
       D::Good,
       {0.02, 0.02, 3e-6}},
      {"shake",
       16,
       "a hand that shakes by 3 mm",
       [](Trial& trial, bool) {
         trial.camera.shake_mm = 3.0;
         trial.camera.samples = 6;
         // The camera is traced again for every pattern, which takes long.
         trial.viewpoints.resize(1);
       },
       D::GoodOrDetected,
       {0.02, 0.02, 1e-5}},
      {.name = "single-photo",
       .row = 21,
       .what = "one photograph of the chart",
       .change = single_photo,
       .limits = {0.02, 1.0, 2e-6},
       .single_photo = true},
      {"start-off",
       4,
       "start 10 % off in pitch, 0.05 in slant",
       [](Trial& trial, bool) {
         trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 1.1);
         trial.start.sheet.slant = trial.sheet.slant - 0.05;
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"alias-half",
       5,
       "start at half the pitch",
       [](Trial& trial, bool) {
         trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 0.5);
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"alias-double",
       5,
       "start at twice the pitch",
       [](Trial& trial, bool) {
         trial.start.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * 2.0);
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"slow-panel",
       17,
       "20 ms response, 10 ms settling",
       [](Trial& trial, bool) {
         trial.link.response_ms = 20.0;
         trial.link.scan_out_ms = 12.0;
         trial.camera.rolling_shutter_ms = 15.0;
         trial.capture.settle = std::chrono::milliseconds(10);  // enough for a fast panel only
       },
       D::GoodOrDetected,
       {0.02, 0.02, 1e-5}},
      {"chroma-420",
       18,
       "a link of 4:2:0",
       [](Trial& trial, bool) {
         trial.viewpoints.resize(1);
         trial.link.chroma = Chroma::HalfBoth;
         trial.link_and_spot = true;
         trial.camera.bayer = true;
       },
       D::Detected,
       {},
       "4:2:0"},
      {"bgr",
       18,
       "a panel of BGR",
       [](Trial& trial, bool) {
         trial.viewpoints.resize(1);
         trial.link.actual_layout = optics::SubpixelLayout::bgr();
       },
       D::Detected,
       {},
       "BGR"},
      {"pentile",
       18,
       "red and blue in turn",
       [](Trial& trial, bool) {
         trial.viewpoints.resize(1);
         const optics::SubpixelOffset left{1.0 / 6.0, 0.5}, middle{0.5, 0.5}, right{5.0 / 6.0, 0.5};
         trial.link.actual_layout =
             optics::SubpixelLayout::cells(2, 1, {{left, middle, right}, {right, middle, left}});
       },
       D::Detected,
       {},
       "layout"},
      {"curved",
       23,
       "a panel bent by 1500 mm",
       [](Trial& trial, bool full) {
         trial = finer_base(full);
         trial.sheet.curve_radius_mm = 1500.0;
       },
       D::Detected,
       {},
       "curved"},
      {"deformed",
       11,
       "a sheet off by 0.1 lens",
       [](Trial& trial, bool full) {
         trial = finer_base(full);
         trial.sheet.deformation_lenses = 0.1;
       },
       D::Good,
       {0.02, 0.02, 1e-5, 0.005}},
      {"gap-bow",
       12,
       "a gap 5 % wider in the middle",
       [](Trial& trial, bool) { trial.sheet.gap_bow = 0.05; },
       D::GoodOrDetected,
       {0.02, 0.02, 1e-5}},
      {"bubbles",
       13,
       "2 % bubbles, scratches, a logo",
       [](Trial& trial, bool) {
         trial.sheet.bubbles = 0.02;
         trial.sheet.scratches = 3;
         trial.link.logo_left = 0.75;
         trial.link.logo_width = 0.15;
         trial.link.logo_top = trial.link.logo_height = 0.1;
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      // Whole numbers of subpixels and rows: lenses and subpixels stay aligned over the whole
      // panel.
      {.name = "vertical-6",
       .row = 19,
       .what = "pitch 6, vertical lenses",
       .change = [](Trial& trial, bool) { set_pitch(6.0, 0.0, trial); },
       .limits = {0.02, 0.02, 1e-6},
       .shortfall = "a lens has two green subpixels, always at the same phases: the phases between "
                    "them are not visible, so nothing can be measured"},
      {"third-6",
       19,
       "pitch 6, slant 1/3",
       [](Trial& trial, bool) { set_pitch(6.0, 1.0 / 3.0, trial); },
       D::Good,
       {0.02, 0.02, 1e-6}},
      {"wide-40",
       20,
       "pitch 40",
       [](Trial& trial, bool full) {
         // A wider cone, because a sheet with proportionally thick wide lenses does not exist.
         if (!full) trial = small_trial(1920, 1080);
         set_pitch(40.0, trial.sheet.slant, trial);
       },
       D::Good,
       {0.02, 0.02, 2e-6}},
      {"fine-4",
       20,
       "pitch 4",
       [](Trial& trial, bool) { set_pitch(4.0, trial.sheet.slant, trial); },
       D::GoodOrDetected,
       {0.02, 0.02, 2e-6}},
      {"warming", 22, "0.2 K warmer at each viewpoint", warming, D::Good, {0.02, 0.02, 2e-5}},
      {.name = "lens-in",
       .row = 24,
       .what = "lenses toward the panel, air between",
       .change = lens_in,
       .limits = {0.02, 0.02, 1e-5},
       .shortfall =
           "such lenses are asymmetric off axis, which the chief-ray model does not describe: "
           "viewpoints contradict each other by 0.05 lens, and the calibration is refused"},
  };
  return table;
}

Trial trial_of(const StressCase& one, StressSize size) {
  const bool full = size == StressSize::Full;
  Trial trial = base(full);
  one.change(trial, full);
  return trial;
}

StressLimits limits_at(const StressCase& one, StressSize size) {
  const Trial full = trial_of(one, StressSize::Full), here = trial_of(one, size);
  const double lenses = static_cast<double>(full.panel.width_px) / here.panel.width_px;
  const double columns = static_cast<double>(full.camera.width) / here.camera.width;
  StressLimits limits = one.limits;
  limits.pitch *= lenses * columns;
  limits.flat_lenses = std::min(kMostFlat, limits.flat_lenses * columns);
  limits.map_rms_lenses = std::min(1.0, limits.map_rms_lenses * columns);
  return limits;
}

namespace {

/// Limit of every trusted rig, independent of the case's own limits.
constexpr double kMostLenses = 0.02;
/// Part of the warning that something moved during the measurement.
constexpr const char* kMoved = "something moved";
/// Pictures until the panel has settled.
constexpr int kSettlePictures = 6;

double largest(const std::vector<double>& values) {
  double most = 0.0;
  for (const double v : values) most = std::max(most, std::abs(v));
  return most;
}

std::string everything_said(const TrialResult& result) {
  std::string said = result.failure;
  const auto add = [&](const std::vector<std::string>& sentences) {
    for (const std::string& s : sentences) said += (said.empty() ? "" : "; ") + s;
  };
  add(result.calibration.reasons);
  add(result.calibration.warnings);
  add(result.calibration.link.findings);
  return said;
}

calib::CameraPicture settled_picture(SimulatedBench& bench) {
  calib::CameraPicture picture;
  for (int n = 0; n < kSettlePictures; ++n)
    if (bench.camera().grab(picture, std::chrono::seconds(10)) != calib::GrabStatus::Ready)
      throw Error(ErrorKind::Device, "camera: no picture");
  return picture;
}

/// Calibrates with the chart and a measured distance instead of patterns.
TrialResult run_photo(const Trial& trial) {
  TrialResult result;
  try {
    SimulatedBench bench(trial.panel, trial.sheet, trial.link, trial.camera, trial.seed);
    const TrialViewpoint& place = trial.viewpoints.front();
    bench.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
    const calib::SinglePhotoChart chart = calib::plan_single_photo_chart(trial.start);
    const frames::WovenFrame frame = draw_single_photo_chart(chart);
    if (bench.sink().show(frame.view(), std::chrono::seconds(10)) != frames::ShowResult::Shown)
      throw Error(ErrorKind::Device, "display: the chart is not shown");
    calib::PhotoPriors tape;
    tape.distance_mm = calib::Estimate{place.position_mm.z, 3.0};
    result.calibration = fit_single_photo(settled_picture(bench), chart, tape);
    evaluate_trial(trial, bench, result);
  } catch (const Error& error) {
    result.failure = error.what();
  }
  return result;
}

bool within(const StressLimits& limits, const StressOutcome& outcome) {
  return outcome.flat_lenses <= limits.flat_lenses &&
         outcome.errors.worst_lenses <= limits.worst_lenses && outcome.pitch <= limits.pitch &&
         outcome.errors.map_rms_lenses <= limits.map_rms_lenses;
}

/// Returns true if a trusted result is wrong. An intrinsic rig is for every eye of the zone, an
/// effective one for the viewpoints. The comparison is not <=, so that NaN counts as wrong.
bool misleads(Verdict verdict, const StressOutcome& outcome) {
  const TrialErrors& errors = outcome.errors;
  if (verdict == Verdict::Refused) return false;
  if (verdict == Verdict::Effective) {
    const bool warned = outcome.said.find(kMoved) != std::string::npos;
    return !warned && !(largest(errors.flat_lenses) <= kMostLenses);
  }
  return !(errors.worst_lenses <= kMostLenses);
}

double first_of(const std::vector<double>& values) {
  return values.empty() ? 0.0 : std::abs(values.front());
}

bool meets(const StressCase& one, const StressOutcome& outcome) {
  if (outcome.wrong) return false;
  switch (one.demand) {
    case StressDemand::Good:
      return outcome.good;
    case StressDemand::Detected:
      return outcome.named;
    case StressDemand::GoodOrDetected:
      return outcome.good || outcome.verdict != to_string(Verdict::Intrinsic);
  }
  return false;
}

void evaluate(const StressCase& one, const StressLimits& limits, const TrialResult& result,
              StressOutcome& outcome) {
  const Verdict verdict = result.calibration.verdict;
  outcome.measured = result.failure.empty() && !result.calibration.viewpoints.empty();
  outcome.verdict = result.failure.empty() ? to_string(verdict) : "failed";
  outcome.said = everything_said(result);
  outcome.errors = result.errors;
  outcome.pitch = first_of(result.errors.effective_pitch);
  outcome.flat_lenses = first_of(result.errors.flat_lenses);
  outcome.named = !one.named_by.empty() && outcome.said.find(one.named_by) != std::string::npos;
  const Verdict wanted = one.single_photo ? Verdict::Effective : Verdict::Intrinsic;
  outcome.good = outcome.measured && verdict == wanted && within(limits, outcome);
  outcome.wrong = outcome.measured && misleads(verdict, outcome);
  outcome.held = meets(one, outcome);
}

}  // namespace

StressOutcome run_stress_case(const StressCase& one, StressSize size,
                              const std::function<bool()>& may_continue) {
  const auto begin = std::chrono::steady_clock::now();
  Trial trial = trial_of(one, size);
  trial.progress = [&](size_t, int) { return !may_continue || may_continue(); };
  StressOutcome outcome;
  evaluate(one, limits_at(one, size), one.single_photo ? run_photo(trial) : run_trial(trial),
           outcome);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  outcome.seconds = elapsed.count();
  return outcome;
}

}  // namespace lenticule::lab
