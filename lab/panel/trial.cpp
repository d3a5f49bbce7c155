// SPDX-License-Identifier: Apache-2.0
#include "lab/panel/trial.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "optics/model.h"

namespace lenticule::lab {

namespace {

using Clock = std::chrono::steady_clock;

/// Phases are compared at the points of a regular grid over the panel.
struct GridSize {
  int columns = 0;
  int rows = 0;
};
constexpr GridSize kCompared{17, 9};
/// The least-squares line of a phase that is not exactly straight depends on the sample points, so
/// these are the points of the fit.
constexpr GridSize kLine{33, 19};

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Line is constant + x across + y down, with across and down from -1 to 1 over the panel.
struct Line {
  double constant = 0.0;
  double across = 0.0;
  double down = 0.0;
};

/// PhaseGrid holds a phase at every point of a regular grid over the panel, borders included.
class PhaseGrid {
 public:
  template <class Phase>
  PhaseGrid(GridSize size, const Phase& phase) : size_(size) {
    for (int y = 0; y < size.rows; ++y)
      for (int x = 0; x < size.columns; ++x) values_.push_back(phase(across(x), down(y)));
  }
  [[nodiscard]] double across(int x) const { return 2.0 * x / (size_.columns - 1) - 1.0; }
  [[nodiscard]] double down(int y) const { return 2.0 * y / (size_.rows - 1) - 1.0; }

  [[nodiscard]] GridSize size() const { return size_; }
  [[nodiscard]] const std::vector<double>& values() const { return values_; }
  [[nodiscard]] double at(int x, int y) const {
    return values_[static_cast<size_t>(y * size_.columns + x)];
  }

  /// Returns the least-squares line; across and down are orthogonal on the grid.
  [[nodiscard]] Line line() const {
    Line sum;
    double across_squares = 0.0, down_squares = 0.0;
    for (int y = 0; y < size_.rows; ++y)
      for (int x = 0; x < size_.columns; ++x) {
        sum.constant += at(x, y);
        sum.across += at(x, y) * across(x);
        sum.down += at(x, y) * down(y);
        across_squares += across(x) * across(x);
        down_squares += down(y) * down(y);
      }
    return {sum.constant / static_cast<double>(values_.size()), sum.across / across_squares,
            sum.down / down_squares};
  }

 private:
  GridSize size_;
  std::vector<double> values_;
};

double true_phase(const SimulatedBench& bench, double x_px, double y_px, const Vec3& eye) {
  return bench.ground_truth_phase(x_px, y_px, 1, eye, LightMiddle::Centroid);
}

/// Return green's phase for one eye: on the bench, and of a rig.
PhaseGrid true_phases(const SimulatedBench& bench, const optics::Panel& panel, const Vec3& eye,
                      GridSize size = kCompared) {
  return PhaseGrid(size, [&](double u, double v) {
    return true_phase(bench, 0.5 * panel.width_px * (1.0 + u), 0.5 * panel.height_px * (1.0 + v),
                      eye);
  });
}
PhaseGrid found_phases(const optics::OpticalModel& model, const Vec3& eye,
                       GridSize size = kCompared) {
  const optics::Panel& panel = model.rig().panel;
  return PhaseGrid(size, [&](double u, double v) {
    return model.phase(0.5 * panel.width_px * (1.0 + u), 0.5 * panel.height_px * (1.0 + v), 1,
                       {eye.x, eye.y, eye.z});
  });
}

double slant_of(const Line& line, const optics::Panel& panel) {
  return line.down / line.across * panel.width_px / panel.height_px;
}

Vec3 middle_eye(const Trial& trial) {
  double z = 0.0;
  for (const TrialViewpoint& v : trial.viewpoints) z += v.position_mm.z;
  return {0.0, 0.0, z / static_cast<double>(trial.viewpoints.size())};
}

/// Returns the change of the phase at the panel's centre with the eye's position.
template <class Phase>
double parallax(const Phase& phase, const Vec3& eye) {
  constexpr double kStep = 30.0;
  return phase(Vec3{eye.x + kStep, eye.y, eye.z}) - phase(Vec3{eye.x - kStep, eye.y, eye.z});
}

double gap_error(const optics::OpticalModel& model, const SimulatedBench& bench, const Vec3& eye) {
  const optics::Panel& panel = model.rig().panel;
  const double x = panel.width_px / 2.0, y = panel.height_px / 2.0;
  const double ground_truth =
      parallax([&](const Vec3& e) { return true_phase(bench, x, y, e); }, eye);
  const double found = parallax(
      [&](const Vec3& e) {
        return model.phase(x, y, 1, {e.x, e.y, e.z});
      },
      eye);
  return found / ground_truth - 1.0;
}

double map_error(const PhaseGrid& found, const PhaseGrid& ground_truth) {
  const Line a = found.line(), b = ground_truth.line();
  double square = 0.0;
  for (int y = 0; y < ground_truth.size().rows; ++y)
    for (int x = 0; x < ground_truth.size().columns; ++x) {
      const double line = (a.constant - b.constant) +
                          (a.across - b.across) * ground_truth.across(x) +
                          (a.down - b.down) * ground_truth.down(y);
      const double off = found.at(x, y) - ground_truth.at(x, y) - line;
      square += off * off;
    }
  return std::sqrt(square / static_cast<double>(ground_truth.values().size()));
}

/// Returns the error of a phase without whole lenses.
double phase_off(double found, double ground_truth) {
  const double off = found - ground_truth;
  return off - std::round(off);
}

/// Keeps the larger value; NaN stays.
void keep_larger(double value, double& most) {
  if (!(value <= most) && !std::isnan(most)) most = value;
}

double worst_off(const PhaseGrid& found, const PhaseGrid& ground_truth) {
  double worst = 0.0;
  for (size_t n = 0; n < ground_truth.values().size(); ++n)
    keep_larger(std::abs(phase_off(found.values()[n], ground_truth.values()[n])), worst);
  return worst;
}

std::vector<double> flat_errors(const calib::Calibration& calibration, const SimulatedBench& bench,
                                const Trial& trial) {
  const optics::OpticalModel model(calibration.rig);
  std::vector<double> worst;
  for (size_t v = 0; v < calibration.viewpoints.size(); ++v) {
    const Vec3& seen_from = trial.viewpoints[v].position_mm;
    worst.push_back(worst_off(found_phases(model, calibration.viewpoints[v].eye_mm),
                              true_phases(bench, trial.panel, seen_from)));
  }
  return worst;
}

/// Adds the errors of the line that the rig shows at the fitted camera position.
void add_effective(const calib::Calibration& calibration, const SimulatedBench& bench,
                   const Trial& trial, TrialErrors& errors) {
  const optics::OpticalModel model(calibration.rig);
  for (size_t v = 0; v < calibration.viewpoints.size(); ++v) {
    const Vec3& place = trial.viewpoints[v].position_mm;
    const Line ground_truth = true_phases(bench, trial.panel, place, kLine).line();
    const Line found = found_phases(model, calibration.viewpoints[v].eye_mm, kLine).line();
    errors.effective_pitch.push_back(ground_truth.across / found.across - 1.0);
    errors.effective_slant.push_back(slant_of(found, trial.panel) -
                                     slant_of(ground_truth, trial.panel));
  }
}

void measure_all(const Trial& trial, SimulatedBench& bench, TrialResult& result) {
  const optics::OpticalModel start(trial.start);
  for (size_t v = 0; v < trial.viewpoints.size(); ++v) {
    const TrialViewpoint& place = trial.viewpoints[v];
    bench.move_camera(place.position_mm, place.look_at_mm, place.roll_degrees);
    if (trial.before_viewpoint) trial.before_viewpoint(bench, v);
    const calib::Nanoseconds begin = bench.camera().now();
    int pattern = 0;
    const calib::CaptureProgress progress = [&](const calib::Pattern&) {
      const int now = pattern++;
      if (trial.before_pattern) trial.before_pattern(bench, v, now);
      return !trial.progress || trial.progress(v, now);
    };
    const calib::MeasureOptions options{.name = place.name,
                                        .link_and_spot = trial.link_and_spot && v == 0};
    result.measurements.push_back(
        measure_viewpoint(bench.sink(), bench.camera(), start, trial.capture, options, progress));
    const std::chrono::duration<double> shown = bench.camera().now() - begin;
    result.shown_seconds = std::max(result.shown_seconds, shown.count());
  }
}

/// Returns eyes all over the viewing zone of the options, at three distances.
std::vector<Vec3> zone_eyes(const Trial& trial) {
  const Vec3 middle = middle_eye(trial);
  std::vector<Vec3> eyes;
  for (const double part : {0.8, 1.0, 1.2})
    for (const double side : {-1.0, -0.5, 0.0, 0.5, 1.0})
      eyes.push_back({side * trial.options.zone_half_width_mm, 0.0, part * middle.z});
  return eyes;
}

}  // namespace

TrialErrors errors_of(const optics::Rig& found, const SimulatedBench& bench, const Trial& trial) {
  const optics::OpticalModel model(found);
  TrialErrors errors;
  double square = 0.0;
  size_t count = 0;
  for (const Vec3& eye : zone_eyes(trial)) {
    const PhaseGrid ground_truth = true_phases(bench, trial.panel, eye);
    const PhaseGrid said = found_phases(model, eye);
    for (size_t n = 0; n < ground_truth.values().size(); ++n) {
      const double off = phase_off(said.values()[n], ground_truth.values()[n]);
      keep_larger(std::abs(off), errors.worst_lenses);
      square += off * off;
      ++count;
    }
  }
  errors.rms_lenses = std::sqrt(square / static_cast<double>(count));
  const Vec3 middle = middle_eye(trial);
  errors.pitch = found.sheet.pitch.value / trial.sheet.pitch_subpx - 1.0;
  errors.slant = found.sheet.slant - trial.sheet.slant;
  errors.gap = gap_error(model, bench, middle);
  errors.map_rms_lenses =
      map_error(found_phases(model, middle), true_phases(bench, trial.panel, middle));
  return errors;
}

void evaluate_trial(const Trial& trial, const SimulatedBench& bench, TrialResult& result) {
  if (result.calibration.viewpoints.empty()) return;
  result.errors = errors_of(result.calibration.rig, bench, trial);
  result.errors.flat_lenses = flat_errors(result.calibration, bench, trial);
  add_effective(result.calibration, bench, trial, result.errors);
  if (!trial.single_too || result.measurements.empty()) return;
  const calib::Calibration alone =
      calibrate({result.measurements.front()}, trial.start, trial.options);
  if (!alone.viewpoints.empty()) add_effective(alone, bench, trial, result.single);
}

TrialResult run_trial(const Trial& trial) {
  const Clock::time_point begin = Clock::now();
  TrialResult result;
  try {
    SimulatedBench bench(trial.panel, trial.sheet, trial.link, trial.camera, trial.seed);
    measure_all(trial, bench, result);
    result.calibration = calibrate(result.measurements, trial.start, trial.options);
    evaluate_trial(trial, bench, result);
  } catch (const Error& error) {
    result.failure = error.what();
  }
  result.wall_seconds = seconds_since(begin);
  return result;
}

optics::Panel trial_panel(int width, int height) {
  optics::Panel panel;
  panel.width_px = width;
  panel.height_px = height;
  panel.pixel_width = Millimetres(597.8 / width);
  panel.pixel_height = Millimetres(336.3 / height);
  return panel;
}

namespace {

/// Returns the rig that a user would start with: nominal numbers.
optics::Rig nominal_rig(const Trial& trial, double pitch_factor, double slant_error,
                        double gap_factor) {
  const ChiefRay ground_truth = chief_ray(trial.sheet, 1);
  optics::Rig rig;
  rig.name = "start";
  rig.panel = trial.panel;
  rig.sheet.pitch = Subpixels(trial.sheet.pitch_subpx * pitch_factor);
  rig.sheet.slant = trial.sheet.slant + slant_error;
  rig.sheet.gap = Millimetres(ground_truth.gap_mm * gap_factor);
  rig.sheet.refraction_shape = 0.45;
  rig.viewing.distance = Millimetres(700.0);
  return rig;
}

/// Changes the number of pixels but not the field of view.
void scale_camera(int width, int height, SimulatedCamera& camera) {
  const double factor = static_cast<double>(width) / camera.width;
  camera.width = width;
  camera.height = height;
  camera.focal_px *= factor;
  camera.centre_x_px *= factor;
  camera.centre_y_px *= factor;
}

void size_camera(int width, int height, double panel_part, SimulatedCamera& camera) {
  camera.width = width;
  camera.height = height;
  camera.focal_px = panel_part * width * 700.0 / 597.8;
  camera.centre_x_px = width / 2.0;
  camera.centre_y_px = height / 2.0;
}

}  // namespace

Trial plain_trial(int panel_width, int panel_height, int camera_width, int camera_height) {
  Trial trial;
  trial.panel = trial_panel(panel_width, panel_height);
  trial.sheet.pitch_subpx = 7.70123;
  trial.sheet.slant = 0.2521;
  trial.sheet.offset_lenses = 0.31;
  // Lenses with the same number of subpixels are wider on a coarser panel, and thicker in
  // proportion.
  const double coarser = 3840.0 / panel_width;
  trial.sheet.radius_mm = 1.1 * coarser;
  trial.sheet.thickness_mm = 3.3 * coarser;
  size_camera(camera_width, camera_height, 0.65, trial.camera);
  trial.camera.k1 = -0.03;
  trial.camera.read_noise = 0.005;
  trial.camera.shot_noise = 0.005;
  trial.viewpoints = {{"centre", {10, 20, 700}, {0, 0, 0}, 0.0},
                      {"left", {-240, 0, 690}, {0, 0, 0}, 1.0},
                      {"right", {265, 30, 720}, {0, 0, 0}, -1.0}};
  trial.start = nominal_rig(trial, 1.02, -0.01, 0.9);
  return trial;
}

// Draws random sheets and cameras.

namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kDistanceMm = 700.0;
constexpr std::array<double, 3> kSidewaysMm{-250.0, 0.0, 250.0};

/// Draws a lens that focuses on the pixels: thickness and radius follow from the cone and the
/// index.
void draw_lens(PortableRandom& random, const optics::Panel& panel, SimulatedSheet& sheet) {
  const double green = random.uniform(1.45, 1.60);
  const double dispersion = random.uniform(0.002, 0.006);
  sheet.index = {green - dispersion, green, green + dispersion};
  const double slant_mm = sheet.slant * panel.pixel_width.value / panel.pixel_height.value;
  const double across_mm =
      sheet.pitch_subpx / 3.0 * panel.pixel_width.value / std::hypot(1.0, slant_mm);
  const double cone = random.uniform(8.0, 24.0) * kDegree;
  const double gap_mm = across_mm / (2.0 * std::tan(cone / 2.0));
  sheet.radius_mm = gap_mm * (green - 1.0);
  sheet.thickness_mm = green * gap_mm * random.uniform(0.95, 1.05);
}

void draw_sensor(PortableRandom& random, SimulatedCamera& camera) {
  const double noise = random.uniform(0.01, 0.05);
  const double shot_part = random.uniform(0.3, 0.9);
  camera.shot_noise = noise * std::sqrt(shot_part);
  camera.read_noise = noise * std::sqrt(1.0 - shot_part);
  const double leak = random.uniform(0.0, 0.15);  // leak to the neighbouring colour
  camera.response = {{{1.0, leak, 0.0}, {leak, 1.0, leak}, {0.0, leak, 1.0}}};
  const bool compressed = random.uniform() < 0.7;
  camera.jpeg_quality = compressed ? static_cast<int>(random.uniform(80.0, 96.0)) : 0;
  camera.rolling_shutter_ms = 15.0;
  camera.exposure_ms = 1000.0 / 60.0;
}

/// Sets only position_mm, look_at_mm and roll_degrees, as in random_camera.
void random_place(PortableRandom& random, int viewpoint, SimulatedCamera& camera) {
  LENTICULE_CHECK(viewpoint >= 0 && viewpoint < 3);
  const double sideways = kSidewaysMm[static_cast<size_t>(viewpoint)];
  camera.position_mm = {sideways + random.uniform(-30.0, 30.0), random.uniform(-30.0, 30.0),
                        kDistanceMm + random.uniform(-30.0, 30.0)};
  camera.look_at_mm = {random.uniform(-20.0, 20.0), random.uniform(-20.0, 20.0), 0.0};
  camera.roll_degrees = random.uniform(-3.0, 3.0);
}

}  // namespace

SimulatedSheet random_sheet(PortableRandom& random, const optics::Panel& panel) {
  SimulatedSheet sheet;
  sheet.pitch_subpx =
      4.0 * std::pow(10.0, random.uniform());  // fine pitches are as likely as coarse ones
  sheet.slant = std::tan(random.uniform(-30.0, 30.0) * kDegree);
  sheet.offset_lenses = random.uniform(-0.5, 0.5);
  draw_lens(random, panel, sheet);
  sheet.deformation_lenses = random.uniform(0.0, 0.15);
  sheet.black_matrix = random.uniform(0.1, 0.5);
  sheet.seed = random.bits();
  return sheet;
}

SimulatedCamera random_camera(PortableRandom& random, const optics::Panel& panel, int viewpoint) {
  SimulatedCamera camera;
  random_place(random, viewpoint, camera);
  const double part = random.uniform(0.55, 0.80);
  const double panel_mm = panel.width_px * panel.pixel_width.value;
  camera.focal_px = part * camera.width * kDistanceMm / panel_mm;
  camera.centre_x_px = camera.width / 2.0 + random.uniform(-20.0, 20.0);
  camera.centre_y_px = camera.height / 2.0 + random.uniform(-20.0, 20.0);
  camera.k1 = random.uniform(-0.05, 0.05);
  camera.psf_sigma_px = random.uniform(0.4, 1.2);
  draw_sensor(random, camera);
  return camera;
}

Trial random_trial(uint64_t seed, int panel_width, int panel_height, int camera_width,
                   int camera_height) {
  PortableRandom random(scramble(seed));
  Trial trial;
  trial.seed = random.bits();
  trial.panel = trial_panel(panel_width, panel_height);
  trial.sheet = random_sheet(random, trial.panel);
  trial.link.response_ms = random.uniform(5.0, 10.0);
  trial.camera = random_camera(random, trial.panel, 1);
  scale_camera(camera_width, camera_height, trial.camera);
  // The middle viewpoint comes first, because it is also used alone.
  constexpr std::array<int, 3> kOrder = {1, 0, 2};
  constexpr std::array<const char*, 3> kNames = {"left", "centre", "right"};
  for (const int place : kOrder) {
    SimulatedCamera there = trial.camera;
    random_place(random, place, there);
    trial.viewpoints.push_back({kNames[static_cast<size_t>(place)], there.position_mm,
                                there.look_at_mm, there.roll_degrees});
  }
  trial.start = nominal_rig(trial, random.uniform(0.9, 1.1), random.uniform(-0.02, 0.02),
                            random.uniform(0.75, 1.25));
  return trial;
}
}  // namespace lenticule::lab
