// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "calib/fit/colour_offsets.h"
#include "calib/fit/cross_validation.h"
#include "calib/fit/prediction.h"
#include "calib/fit/residual_cells.h"
#include "calib/fit/verdict.h"

namespace lenticule::calib {
namespace {

/// A single viewpoint shows its distance badly, because the gap is unknown: known distances are
/// compared with this standard error, as a part of the distance, and then held.
constexpr double kSinglePart = 0.025, kHeldMm = 0.1;
/// Remaining aberrations of real lenses beyond the two parameters that the fit has for them: the
/// scatter of `lenticule bench calibrate` beyond that of noise (docs/panel/calibration.md).
constexpr LawError kTracedLenses{
    .pitch_lenses = 0.0005, .slant_lenses = 0.00012, .gap_part = 0.0008};

class Calibrator {
 public:
  Calibrator(const std::vector<ViewpointMeasurement>& viewpoints, const optics::Rig& start,
             const CalibrateOptions& options)
      : measured_(viewpoints),
        options_(options),
        problem_{.views = {},
                 .start = sheet_start(start),
                 .panel = start.panel,
                 .grid = {options.map_columns, options.map_rows}} {
    result_.rig = start;
    problem_.start.gap_tolerance = options.gap_tolerance;
    for (const ViewpointMeasurement& m : viewpoints)
      problem_.views.push_back(view_of(m, problem_.panel));
  }

  Calibration run() {
    const auto begin = std::chrono::steady_clock::now();
    carry_over();
    if (fit()) {
      put_rig();
      measure_colours();
      describe_viewpoints();
      describe_parameters();
      leave_one_out();
      predict();
      judge({measured_, problem_, found_, options_, result_}, findings_);
    }
    put_verdict(std::move(findings_), result_);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    result_.seconds_computing = elapsed.count();
    return std::move(result_);
  }

 private:
  [[nodiscard]] bool several() const { return problem_.several(); }
  [[nodiscard]] const JointFit& fitted() const { return *found_.fit; }
  /// Returns the prediction of the fit. A single viewpoint determines neither pitch nor gap, and
  /// its own picture does not depend on the lens law, so the law's error is omitted.
  [[nodiscard]] Prediction prediction() const {
    return {fitted(), problem_.grid, problem_.panel, several() ? kTracedLenses : LawError{}};
  }

  void refuse(std::string reason) { findings_.refusals.push_back(std::move(reason)); }

  void carry_over() {
    for (const ViewpointMeasurement& m : measured_) {
      for (const std::string& warning : m.warnings)
        findings_.warnings.push_back(fmt::format("{}: {}", m.name, warning));
      if (m.spot) result_.spot = m.spot;
      if (!m.link.findings.empty() || m.spot) result_.link = m.link;
    }
  }

  bool fit();
  void use_distances();
  void put_rig();
  void measure_colours();
  void describe_viewpoints();
  [[nodiscard]] Viewpoint description_of(size_t v, const Prediction& predicted) const;
  void describe_parameters();
  void leave_one_out();
  void predict();

  const std::vector<ViewpointMeasurement>& measured_;
  const CalibrateOptions& options_;
  FitProblem problem_;
  FoundFit found_;
  Findings findings_;
  Calibration result_;
};

/// Replaces the starting pitch, which only served to find fringes, by the pitch of the observed
/// fringes.
void start_from(const ViewpointMeasurement& seen, SheetStart& start, const optics::Panel& panel) {
  start.values[kAcross] = 0.5 * panel.width_px * seen.line.per_px_x;
  start.values[kDown] = 0.5 * panel.height_px * seen.line.per_px_y;
}

bool Calibrator::fit() {
  if (measured_.empty()) {
    refuse("nothing was measured");
    return false;
  }
  start_from(measured_.front(), problem_.start, problem_.panel);
  found_ = search_fit(problem_);
  // Points of a curved panel fit no camera, so that each place seems to have another one.
  if (found_.contradicts && is_flat(fitted(), problem_.panel))
    refuse(sentence_about(find_suspects(problem_, found_)));
  if (!found_.poses) {
    refuse(
        "the place of the camera cannot be determined: no place agrees with the panel points it "
        "saw");
    return false;
  }
  if (several() && !found_.gap) {
    refuse("no gap between lenses and pixels agrees with all viewpoints");
    return false;
  }
  if (found_.rival && !found_.contradicts)
    refuse(
        fmt::format("two gaps agree with the viewpoints about equally well: {:.3f} and {:.3f} mm. "
                    "Add a viewpoint at another distance to the side.",
                    found_.gap->gap_mm, found_.rival->gap_mm));
  if (found_.fit) use_distances();
  if (!found_.fit) refuse("the fit does not converge");
  return found_.fit.has_value();
}

/// Fits again with the measured distances that agree with the fit, and refuses the others.
void Calibrator::use_distances() {
  JointOptions options = problem_.joint_options();
  options.sameness = found_.sameness;
  const Prediction predicted = prediction();
  const std::vector<View>& views = problem_.views;
  for (size_t v = 0; v < std::min(views.size(), options_.distances_mm.size()); ++v) {
    const Estimate& known = options_.distances_mm[v];
    options.distances_mm.emplace_back();
    if (!(known.value > 0.0)) continue;
    Estimate found{fitted().values.poses[v][kPupil + 2], predicted.eye_sigma(v).z};
    if (!several()) found.sigma = std::max(found.sigma, kSinglePart * found.value);
    if (agree(known, found))
      options.distances_mm.back() = {known.value, several() ? known.sigma : kHeldMm};
    else
      refuse(
          fmt::format("{}: the camera is {:.0f} mm from the panel according to the pictures, not "
                      "{:.0f} mm: measure the distance from the panel to the front of the lens, or "
                      "check the panel's size in the rig",
                      views[v].name, found.value, known.value));
  }
  if (std::ranges::any_of(options.distances_mm, [](const Estimate& e) { return e.value > 0.0; }))
    found_.fit =
        fit_jointly(views, *found_.poses, problem_.start, found_.gap, problem_.panel, options);
}

void Calibrator::put_rig() {
  const FitValues& values = fitted().values;
  put_sheet(values.sheet, problem_.grid, values.knots, problem_.panel, result_.rig.sheet);
  if (result_.spot && result_.spot->sigma_lenses > 0.0)
    result_.rig.sheet.spot_sigma = Lenses(result_.spot->sigma_lenses);
  const CameraValues& camera = values.camera;
  result_.camera = {.focal_px = camera[kFocal],
                    .centre_x_px = camera[kCentreX],
                    .centre_y_px = camera[kCentreY],
                    .k1 = camera[kRadial1],
                    .k2 = camera[kRadial2]};
}

void Calibrator::measure_colours() {
  const size_t blocks = problem_.views.front().phases.size() * problem_.views.size();
  const ColourOffsets found = measure_colour_offsets(measured_, blocks);
  optics::LensSheet& sheet = result_.rig.sheet;
  result_.link.channels_swapped = are_swapped(found, sheet.pitch.value);
  if (result_.link.channels_swapped) {
    result_.link.findings.emplace_back(
        "Red and blue are swapped: the panel's subpixels are ordered BGR.");
    return;
  }
  sheet.channel_offset = {Subpixels(found.red.value), Subpixels(0.0), Subpixels(found.blue.value)};
  result_.parameters.push_back({"channel_offset_subpx.red", "subpixels", found.red});
  result_.parameters.push_back({"channel_offset_subpx.blue", "subpixels", found.blue});
}

/// Returns the angle between the camera's axis and the panel's normal.
double tilt_degrees(const PoseValues& pose) {
  const double forward[3] = {0.0, 0.0, 1.0};
  const double back[3] = {-pose[0], -pose[1], -pose[2]};
  double axis[3];
  ceres::AngleAxisRotatePoint(back, forward, axis);
  return std::acos(std::clamp(-axis[2], -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

void Calibrator::describe_viewpoints() {
  const Prediction predicted = prediction();
  for (size_t v = 0; v < problem_.views.size(); ++v)
    result_.viewpoints.push_back(description_of(v, predicted));
}

Viewpoint Calibrator::description_of(size_t v, const Prediction& predicted) const {
  const ViewpointMeasurement& m = measured_[v];
  const View& view = problem_.views[v];
  const FitValues& values = fitted().values;
  const PoseValues& pose = values.poses[v];
  const std::vector<double>& rests = fitted().rests[v];
  Viewpoint out;
  out.name = m.name;
  out.eye_mm = {pose[kPupil], pose[kPupil + 1], pose[kPupil + 2]};
  out.eye_sigma_mm = predicted.eye_sigma(v);
  if (!several() && !options_.distances_mm.empty())
    out.eye_sigma_mm.z = std::max(out.eye_sigma_mm.z, options_.distances_mm[v].sigma);
  out.tilt_degrees = tilt_degrees(pose);
  const EffectiveLine line = predicted.effective_line(out.eye_mm);
  out.effective_pitch_subpx = line.pitch_subpx;
  out.slant = line.slant;
  out.effective_offset_lenses = line.offset_lenses;
  out.contrast = m.contrast;
  out.covered = m.covered;
  out.blocks = static_cast<int>(view.phases.size());
  double square = 0.0;
  for (const double rest : rests) {
    square += rest * rest;
    out.max_lenses = std::max(out.max_lenses, std::abs(rest));
  }
  out.rms_lenses = std::sqrt(square / std::max<double>(1.0, out.blocks));
  out.reprojection_rms_px = fitted().geometry_rms_px;
  out.residual = mean_over_cells(view, pose, camera_of(values.camera, values.own[v], view), rests,
                                 problem_.panel, kPictureCells);
  return out;
}

void Calibrator::describe_parameters() {
  const SheetReport report = prediction().sheet_report();
  result_.parameters.insert(result_.parameters.begin(), report.parameters.begin(),
                            report.parameters.end());
  // Correlations of noise alone: they show whether the viewpoints can separate two parameters.
  result_.correlations =
      Prediction(fitted(), problem_.grid, problem_.panel).sheet_report().correlations;
}

/// Predicts each viewpoint from the others.
void Calibrator::leave_one_out() {
  if (problem_.views.size() < kLeastForPrediction) return;
  for (size_t v = 0; v < problem_.views.size(); ++v)
    if (const auto error = error_from_other_views(problem_, found_, v))
      result_.viewpoints[v].predicted_lenses = *error;
}

void Calibrator::predict() {
  double distance = 0.0;
  for (const Viewpoint& v : result_.viewpoints) distance += v.eye_mm.z;
  distance /= static_cast<double>(result_.viewpoints.size());
  std::vector<Vec3> eyes;
  if (several()) {
    for (const double part : {kNearestEyes, 1.0, kFarthestEyes})
      for (const double side : {-1.0, 0.0, 1.0})
        eyes.push_back({side * options_.zone_half_width_mm, 0.0, part * distance});
  } else {
    eyes.push_back(result_.viewpoints.front().eye_mm);
  }
  result_.drift = prediction().worst_drift(eyes);
}

}  // namespace

Calibration calibrate(const std::vector<ViewpointMeasurement>& viewpoints, const optics::Rig& start,
                      const CalibrateOptions& options) {
  return Calibrator(viewpoints, start, options).run();
}

}  // namespace lenticule::calib
