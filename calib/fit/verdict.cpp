// SPDX-License-Identifier: Apache-2.0
#include "calib/fit/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "calib/fit/cross_validation.h"
#include "calib/measure/mark_moves.h"

namespace lenticule::calib {
namespace {

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

}  // namespace

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

void put_verdict(Findings findings, Calibration& result) {
  result.verdict = !findings.refusals.empty()       ? Verdict::Refused
                   : !findings.restrictions.empty() ? Verdict::Effective
                                                    : Verdict::Intrinsic;
  result.warnings = std::move(findings.warnings);
  result.reasons = std::move(findings.refusals);
  std::ranges::move(findings.restrictions, std::back_inserter(result.reasons));
}

bool agree(const Estimate& a, const Estimate& b) {
  return std::abs(a.value - b.value) <= kMaxPriorSigmas * std::hypot(a.sigma, b.sigma);
}

}  // namespace lenticule::calib
