// SPDX-License-Identifier: Apache-2.0
// The best fit of all views is searched, and repeated with the distances that the user measured.
// Its description follows: the offsets of red and blue, viewpoints, parameters and their
// correlations, the prediction of each viewpoint from the others, and the largest error that is to
// be expected. Then the findings decide: a refusal if a measurement or the model cannot be trusted,
// a restriction to the measured eyes if the viewpoints do not determine the phases of others.
#include "calib/fit/calibrate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string>

#include "calib/fit/joint_fit.h"
#include "calib/fit/prediction.h"
#include "calib/measure/frame_marks.h"

namespace lenticule::calib {
namespace {

// Measures how far the panel's red and blue subpixels are from where its layout places them.

/// ColourOffsets holds the mean phases by which the fringes of red and blue are ahead of green's,
/// in subpixels.
struct ColourOffsets {
  Estimate red;
  Estimate blue;
};

constexpr double kBgrOffset = 2.0;  ///< subpixels that red and blue are off when swapped

Estimate offset_from_green(const std::vector<ViewpointMeasurement>& viewpoints, size_t channel,
                           size_t blocks) {
  double sum = 0.0, weight = 0.0, square = 0.0;
  for (const ViewpointMeasurement& m : viewpoints) {
    const std::vector<PhaseBlock>& green = m.blocks[1].blocks;
    const std::vector<PhaseBlock>& other = m.blocks[channel].blocks;
    for (size_t n = 0; n < green.size(); ++n) {
      if (green[n].pixels == 0 || other[n].pixels == 0) continue;
      const double ahead = other[n].phase - green[n].phase;
      const double subpixels = (ahead - std::round(ahead)) * m.line.pitch_subpx();
      const double w = green[n].pixels;
      sum += w * subpixels;
      square += w * subpixels * subpixels;
      weight += w;
    }
  }
  if (!(weight > 0.0)) return {};
  const double mean = sum / weight;
  return {mean, std::sqrt(std::max(0.0, square / weight - mean * mean) /
                          std::max(1.0, static_cast<double>(blocks)))};
}

/// Returns the offsets, means over all viewpoints. The standard errors are those of means of
/// `blocks` independent values.
ColourOffsets measure_colour_offsets(const std::vector<ViewpointMeasurement>& viewpoints,
                                     size_t blocks) {
  return {.red = offset_from_green(viewpoints, 0, blocks),
          .blue = offset_from_green(viewpoints, 2, blocks)};
}

/// Returns true if red and blue are swapped: the subpixels are ordered BGR.
bool are_swapped(const ColourOffsets& offsets, double pitch_subpx) {
  // Twice a subpixel in either direction: red and blue are swapped. Phases repeat after a pitch.
  const auto apart = [&](double a, double b) {
    const double turns = (a - b) / pitch_subpx;
    return std::abs(turns - std::round(turns)) * pitch_subpx;
  };
  return apart(offsets.red.value, kBgrOffset) < 0.6 &&
         apart(offsets.blue.value, -kBgrOffset) < 0.6 && apart(offsets.red.value, 0.0) > 0.6;
}

// Judges a calibration: collects the reasons that refuse it or restrict it to the measured eyes,
// and the warnings.

/// Findings holds sentences for the user, each list in the order in which they were found.
struct Findings {
  std::vector<std::string> refusals;      ///< reasons why the calibration must not be used
  std::vector<std::string> restrictions;  ///< reasons why it is valid for the measured eyes only
  std::vector<std::string> warnings;      ///< notes that do not change the verdict
};

/// CalibrationEvidence holds the inputs of a judgement: the measurements, the fit and the described
/// result.
///
/// Lifetime: must not outlive the objects that it refers to.
struct CalibrationEvidence {
  const std::vector<ViewpointMeasurement>& measured;
  const FitProblem& problem;
  const FoundFit& found;  ///< has a fit
  const CalibrateOptions& options;
  const Calibration& result;  ///< all but verdict, reasons and warnings
};

constexpr double kMostRmsLenses = 0.05;    ///< phase residual: above this, no model of this sheet
constexpr double kLeastCovered = 0.55;     ///< fraction of the panel, in each viewpoint
constexpr double kMostDriftLenses = 0.05;  ///< drift between first and repeated fringes
constexpr double kNotableDriftLenses = 0.003;  ///< more than the noise of any usable camera
constexpr double kLeastWhite = 0.1;            ///< light of the white panel, relative to full scale
constexpr double kMaxPriorSigmas = 4.0;        ///< deviation from prior knowledge
constexpr double kMostCorrelation = 0.98;      ///< correlation of pitch and gap
constexpr double kLeastColourContrast =
    0.85;  ///< contrast of red and blue fringes relative to green
/// Range of fringe aberrations of lenses on the viewer's side, with a margin; fitted values are
/// compared with three standard errors.
constexpr double kLeastAberration = -0.03;
constexpr double kMostAberration = 0.1;

/// Returns true if two values of one quantity agree within their standard errors.
bool agree(const Estimate& a, const Estimate& b) {
  return std::abs(a.value - b.value) <= kMaxPriorSigmas * std::hypot(a.sigma, b.sigma);
}

/// Detects layouts in which a colour's position varies from pixel to pixel: its fringes blur, and
/// no offset helps.
void evaluate_layout(const std::vector<ViewpointMeasurement>& measured, Findings& findings) {
  for (const ViewpointMeasurement& m : measured) {
    const auto& contrast = m.channel_contrast;
    const double least = std::min(contrast[0], contrast[2]);
    if (!(least > 0.0) || least > kLeastColourContrast * contrast[1]) continue;
    findings.refusals.push_back(
        fmt::format("{}: fringes of red or blue have {:.0f} % of the contrast of green ones: these "
                    "subpixels are not where the panel's layout places them",
                    m.name, 100.0 * least / contrast[1]));
    return;
  }
}

/// Refuses viewpoints that could not be predicted from the others.
void evaluate_predictability(const std::vector<Viewpoint>& viewpoints, Findings& findings) {
  if (viewpoints.size() < kLeastForPrediction) return;
  for (const Viewpoint& v : viewpoints)
    if (std::isnan(v.predicted_lenses))
      findings.refusals.push_back(
          fmt::format("{}: the other viewpoints do not suffice to predict it", v.name));
}

/// Warns of eyes outside the measured angles. Real lenses have aberrations that grow steeply with
/// the angle to the side. The fit covers the observed angles; beyond the steepest one only the law
/// of the chief ray is known.
void warn_of_near_eyes(const std::vector<Viewpoint>& viewpoints, const optics::Panel& panel,
                       double zone_half_width_mm, Findings& findings) {
  const double half_mm = 0.5 * panel.width_px * panel.pixel_width.value;
  double steepest = 0.0, distance = 0.0;
  for (const Viewpoint& v : viewpoints) {
    steepest = std::max(steepest, (half_mm + std::abs(v.eye_mm.x)) / v.eye_mm.z);
    distance += v.eye_mm.z / static_cast<double>(viewpoints.size());
  }
  const double nearest_known = (half_mm + zone_half_width_mm) / steepest;
  if (nearest_known > kNearestEyes * distance)
    findings.warnings.push_back(
        fmt::format("for eyes {:.0f} mm to the side and nearer than {:.0f} mm the far edge of the "
                    "panel is extrapolated: add a viewpoint there if viewers will be there",
                    zone_half_width_mm, nearest_known));
}

/// Refuses dark pictures. If a white panel is hardly lighter than the camera's noise and code
/// steps, the dark parts of waves are clipped, and they are decoded to wrong positions without
/// visible jumps.
void evaluate_light(const ViewpointMeasurement& measured, Findings& findings) {
  if (measured.white_light == 0.0 || measured.white_light >= kLeastWhite) return;
  findings.refusals.push_back(
      fmt::format("{}: the white panel gives {:.1f} % of the camera's full scale, {:.0f} % are "
                  "needed: expose longer, or make the panel brighter",
                  measured.name, 100.0 * measured.white_light, 100.0 * kLeastWhite));
}

/// Refuses pictures of a place between which the camera or the panel moved: they belong to two
/// viewpoints.
void evaluate_moves(const ViewpointMeasurement& measured, Findings& findings) {
  const std::optional<MarkStep> step = find_step(measured.mark_moves);
  if (!step) return;
  findings.refusals.push_back(
      fmt::format("{}: {}, or the panel did: from then on the panel is {:.1f} pixels from where it "
                  "was before; photograph this place again",
                  measured.name, moved_between(step->picture), step->length_px));
}

void evaluate_viewpoint(const Viewpoint& viewpoint, const ViewpointMeasurement& measured,
                        Findings& findings) {
  evaluate_light(measured, findings);
  evaluate_moves(measured, findings);
  if (viewpoint.rms_lenses > kMostRmsLenses)
    findings.refusals.push_back(
        fmt::format("{}: the phase residual is {:.3f} lens rms: no lens sheet explains it",
                    viewpoint.name, viewpoint.rms_lenses));
  if (viewpoint.covered < kLeastCovered)
    findings.refusals.push_back(
        fmt::format("{}: only {:.0f} % of the visible part of the panel could be used",
                    viewpoint.name, 100.0 * viewpoint.covered));
  if (measured.drift_lenses > kMostDriftLenses)
    findings.refusals.push_back(
        fmt::format("{}: something moved by {:.3f} lens during the measurement: the camera, the "
                    "sheet, or its temperature",
                    viewpoint.name, measured.drift_lenses));
  else if (measured.drift_lenses > kNotableDriftLenses)
    findings.warnings.push_back(
        fmt::format("{}: something moved by {:.3f} lens during the measurement; put the camera on "
                    "a stand for a more exact result",
                    viewpoint.name, measured.drift_lenses));
}

/// Refuses a focal length that contradicts the known one.
void evaluate_focal_length(const Estimate& known, const Calibration& result, Findings& findings) {
  const Viewpoint& first = result.viewpoints.front();
  // The relative errors of focal length and distance are equal.
  const double part = first.eye_sigma_mm.z / first.eye_mm.z;
  const double found = result.camera.focal_px;
  if (agree(known, {found, part * found})) return;
  findings.refusals.push_back(
      fmt::format("the camera's focal length is {:.0f} px according to the pictures, not {:.0f} px",
                  found, known.value));
}

void evaluate_flatness(const JointFit& fit, const optics::Panel& panel, Findings& findings) {
  if (is_flat(fit, panel)) return;
  findings.refusals.push_back(
      fmt::format("the panel points deviate from a flat panel by {:.1f} pixels: check whether "
                  "the panel is curved, or the camera zoomed between the viewpoints",
                  fit.geometry_rms_px));
}

void evaluate_link(const LinkCheck& link, Findings& findings) {
  if (link.chroma_subsampled || link.scaled)
    findings.refusals.emplace_back(
        "the link or the panel alters single subpixels (see the link check)");
  if (link.channels_swapped)
    findings.refusals.emplace_back(
        "the panel's subpixels are ordered BGR: set layout = \"bgr\" in the rig and start over");
}

/// Checks the aberration. The fit separates aberration and sheet by the form of the aberration,
/// which is that of lenses on the viewer's side. Another sign or size means another form, and then
/// neither value is right.
void evaluate_aberration(const JointFit& fit, Findings& findings) {
  const double found = fit.values.sheet[kAberration];
  const double variance = fit.covariance(kAberration, kAberration);
  const double room = 3.0 * std::sqrt(std::max(0.0, variance));
  if (found + room < kLeastAberration || found - room > kMostAberration)
    findings.refusals.push_back(fmt::format(
        "seen from the side, the fringes move in a way that lenses on the viewer's side cannot "
        "cause (aberration {:.3f} gaps): check whether the lenses face the panel",
        found));
}

/// Refuses viewpoints whose prediction from the others is wrong.
void evaluate_prediction(const std::vector<Viewpoint>& viewpoints, double most_lenses,
                         Findings& findings) {
  for (const Viewpoint& viewpoint : viewpoints)
    if (viewpoint.predicted_lenses > most_lenses)
      findings.refusals.push_back(
          fmt::format("{}: the other viewpoints predict its phase only to {:.3f} lens",
                      viewpoint.name, viewpoint.predicted_lenses));
}

/// Restricts calibrations whose viewpoints do not determine the phases for other eyes.
void restrict_to_measured_eyes(const Calibration& result, double most_drift_lenses,
                               Findings& findings) {
  std::vector<std::string>& restrictions = findings.restrictions;
  if (result.viewpoints.size() < 2) {
    restrictions.emplace_back(
        "one viewpoint cannot separate the lens pitch from the gap: valid for this eye only");
    return;
  }
  if (result.drift.worst_lenses > most_drift_lenses)
    restrictions.push_back(fmt::format(
        "away from the viewpoints the phase may be off by {:.3f} lens: add a viewpoint further "
        "to the side",
        result.drift.worst_lenses));
  if (result.viewpoints.size() < kLeastForPrediction)
    restrictions.emplace_back(
        "with two viewpoints the prediction for other places cannot be checked: add a third");
  const double correlation = result.correlations[0][3];
  if (std::abs(correlation) > kMostCorrelation)
    restrictions.push_back(
        fmt::format("lens pitch and gap are correlated by {:.3f}: viewpoints further apart would "
                    "separate them",
                    correlation));
}

/// Appends the findings about a calibration.
void judge(const CalibrationEvidence& evidence, Findings& findings) {
  const auto& [measured, problem, found, options, result] = evidence;
  const JointFit& fit = *found.fit;
  evaluate_layout(measured, findings);
  evaluate_predictability(result.viewpoints, findings);
  if (problem.several())
    warn_of_near_eyes(result.viewpoints, problem.panel, options.zone_half_width_mm, findings);
  for (size_t v = 0; v < measured.size(); ++v)
    evaluate_viewpoint(result.viewpoints[v], measured[v], findings);
  if (!found.contradicts && found.sameness == CameraSameness::Nearly)
    std::ranges::move(notes_of(problem.views, fit.values.own),
                      std::back_inserter(findings.warnings));
  if (options.focal_px) evaluate_focal_length(*options.focal_px, result, findings);
  evaluate_flatness(fit, problem.panel, findings);
  evaluate_link(result.link, findings);
  evaluate_aberration(fit, findings);
  if (!found.contradicts)
    evaluate_prediction(result.viewpoints, options.most_held_out_lenses, findings);
  restrict_to_measured_eyes(result, options.most_drift_lenses, findings);
}

/// Writes verdict, reasons and warnings into a calibration.
void set_verdict(Findings findings, Calibration& result) {
  result.verdict = !findings.refusals.empty()       ? Verdict::Refused
                   : !findings.restrictions.empty() ? Verdict::Effective
                                                    : Verdict::Intrinsic;
  result.warnings = std::move(findings.warnings);
  result.reasons = std::move(findings.refusals);
  std::ranges::move(findings.restrictions, std::back_inserter(result.reasons));
}

/// A single viewpoint shows its distance badly, because the gap is unknown: known distances are
/// compared with this standard error, as a part of the distance, and then held.
constexpr double kSinglePart = 0.025, kHeldMm = 0.1;
/// Remaining aberrations of real lenses beyond the two parameters that the fit has for them: the
/// scatter of `lenticule bench calibrate` beyond that of noise (docs/panel/calibration-method.md).
constexpr LawError kTracedLenses{
    .pitch_lenses = 0.0005, .slant_lenses = 0.00012, .gap_part = 0.0008};

/// Replaces the starting pitch, which only served to find fringes, by the pitch of the observed
/// fringes.
void start_from(const ViewpointMeasurement& seen, SheetStart& start, const optics::Panel& panel) {
  start.values[kAcross] = 0.5 * panel.width_px * seen.line.per_px_x;
  start.values[kDown] = 0.5 * panel.height_px * seen.line.per_px_y;
}

/// Returns the angle between the camera's axis and the panel's normal.
double tilt_degrees(const PoseValues& pose) {
  const double forward[3] = {0.0, 0.0, 1.0};
  const double back[3] = {-pose[0], -pose[1], -pose[2]};
  double axis[3];
  ceres::AngleAxisRotatePoint(back, forward, axis);
  return std::acos(std::clamp(-axis[2], -1.0, 1.0)) * 180.0 / std::numbers::pi;
}

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
      set_rig();
      measure_colours();
      describe_viewpoints();
      describe_parameters();
      leave_one_out();
      predict();
      judge({measured_, problem_, found_, options_, result_}, findings_);
    }
    set_verdict(std::move(findings_), result_);
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

  bool fit() {
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
      refuse(fmt::format(
          "two gaps agree with the viewpoints about equally well: {:.3f} and {:.3f} mm. "
          "Add a viewpoint at another distance to the side.",
          found_.gap->gap_mm, found_.rival->gap_mm));
    if (found_.fit) use_distances();
    if (!found_.fit) refuse("the fit does not converge");
    return found_.fit.has_value();
  }

  /// Fits again with the measured distances that agree with the fit, and refuses the others.
  void use_distances() {
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
        refuse(fmt::format(
            "{}: the camera is {:.0f} mm from the panel according to the pictures, not "
            "{:.0f} mm: measure the distance from the panel to the front of the lens, or "
            "check the panel's size in the rig",
            views[v].name, found.value, known.value));
    }
    if (std::ranges::any_of(options.distances_mm, [](const Estimate& e) { return e.value > 0.0; }))
      found_.fit =
          fit_jointly(views, *found_.poses, problem_.start, found_.gap, problem_.panel, options);
  }

  void set_rig() {
    const FitValues& values = fitted().values;
    set_sheet(values.sheet, problem_.grid, values.knots, problem_.panel, result_.rig.sheet);
    if (result_.spot && result_.spot->sigma_lenses > 0.0)
      result_.rig.sheet.spot_sigma = Lenses(result_.spot->sigma_lenses);
    const CameraValues& camera = values.camera;
    result_.camera = {.focal_px = camera[kFocal],
                      .centre_x_px = camera[kCentreX],
                      .centre_y_px = camera[kCentreY],
                      .k1 = camera[kRadial1],
                      .k2 = camera[kRadial2]};
  }

  void measure_colours() {
    const size_t blocks = problem_.views.front().phases.size() * problem_.views.size();
    const ColourOffsets found = measure_colour_offsets(measured_, blocks);
    optics::LensSheet& sheet = result_.rig.sheet;
    result_.link.channels_swapped = are_swapped(found, sheet.pitch.value);
    if (result_.link.channels_swapped) {
      result_.link.findings.emplace_back(
          "Red and blue are swapped: the panel's subpixels are ordered BGR.");
      return;
    }
    sheet.channel_offset = {Subpixels(found.red.value), Subpixels(0.0),
                            Subpixels(found.blue.value)};
    result_.parameters.push_back({"channel_offset_subpx.red", "subpixels", found.red});
    result_.parameters.push_back({"channel_offset_subpx.blue", "subpixels", found.blue});
  }

  void describe_viewpoints() {
    const Prediction predicted = prediction();
    for (size_t v = 0; v < problem_.views.size(); ++v)
      result_.viewpoints.push_back(description_of(v, predicted));
  }

  [[nodiscard]] Viewpoint description_of(size_t v, const Prediction& predicted) const {
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

  void describe_parameters() {
    const SheetReport report = prediction().sheet_report();
    result_.parameters.insert(result_.parameters.begin(), report.parameters.begin(),
                              report.parameters.end());
    // Correlations of noise alone: they show whether the viewpoints can separate two parameters.
    result_.correlations =
        Prediction(fitted(), problem_.grid, problem_.panel).sheet_report().correlations;
  }

  /// Predicts each viewpoint from the others.
  void leave_one_out() {
    if (problem_.views.size() < kLeastForPrediction) return;
    for (size_t v = 0; v < problem_.views.size(); ++v)
      if (const auto error = error_from_other_views(problem_, found_, v))
        result_.viewpoints[v].predicted_lenses = *error;
  }

  void predict() {
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

  const std::vector<ViewpointMeasurement>& measured_;
  const CalibrateOptions& options_;
  FitProblem problem_;
  FoundFit found_;
  Findings findings_;
  Calibration result_;
};

}  // namespace

Calibration calibrate(const std::vector<ViewpointMeasurement>& viewpoints, const optics::Rig& start,
                      const CalibrateOptions& options) {
  return Calibrator(viewpoints, start, options).run();
}

}  // namespace lenticule::calib
