// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/photo_result.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "optics/model.h"

namespace lenticule::calib {
namespace {

constexpr int kGreen = 1;

using Matrix3 = std::array<std::array<double, 3>, 3>;

/// Returns the covariance of at, across and down from the scatter of the blocks and the camera's
/// distance.
Matrix3 plane_covariance(const PhotoMeasurement& work) {
  const std::array<double, 3> farther = {work.farther.at, work.farther.across, work.farther.down};
  Matrix3 out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      out[i][j] = work.sheet.correction.covariance[3 * i + j] + farther[i] * farther[j];
  return out;
}

/// Effective holds effective pitch, slant and offset with their correlations.
struct Effective {
  std::array<Estimate, 3> estimates;
  std::vector<std::vector<double>> correlations;
};

/// Transforms the covariance of at, across and down to that of pitch, slant and offset.
Matrix3 carried_over(const Matrix3& covariance, const LensPlane& plane,
                     const optics::Panel& panel) {
  const double shape = double(panel.width_px) / panel.height_px;
  const double pitch = 3.0 * panel.width_px / plane.across;
  const Matrix3 slopes = {
      {{0.0, -pitch / plane.across, 0.0},
       {0.0, -plane.down * shape / (plane.across * plane.across), shape / plane.across},
       {1.0, 0.0, 0.0}}};
  Matrix3 out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      for (size_t k = 0; k < 9; ++k)
        out[i][j] += slopes[i][k / 3] * slopes[j][k % 3] * covariance[k / 3][k % 3];
  return out;
}

Effective effective_of(const PhotoMeasurement& work) {
  const LensPlane plane = effective_plane(work.sheet.rig, work.camera.pose->eye_mm);
  const optics::Panel& panel = work.sheet.rig.panel;
  const Matrix3 covariance = carried_over(plane_covariance(work), plane, panel);
  const double values[3] = {3.0 * panel.width_px / plane.across, work.sheet.rig.sheet.slant,
                            plane.at - std::round(plane.at)};
  Effective out;
  for (size_t i = 0; i < 3; ++i) {
    out.estimates[i] = {values[i], std::sqrt(covariance[i][i])};
    out.correlations.emplace_back();
    for (size_t j = 0; j < 3; ++j) {
      const double scale = std::sqrt(covariance[i][i] * covariance[j][j]);
      out.correlations[i].push_back(scale > 0.0 ? covariance[i][j] / scale : i == j ? 1.0 : 0.0);
    }
  }
  return out;
}

PanelField residual_field(const PlaneFit& sheet) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  PanelField field{sheet.fringes.columns, sheet.fringes.rows, {}};
  field.values.assign(static_cast<size_t>(field.columns) * static_cast<size_t>(field.rows), kNone);
  // Observed minus fitted lenses: fringes have the opposite sign.
  for (size_t i = 0; i < sheet.blocks.size(); ++i)
    field.values[sheet.blocks[i].block] = -sheet.correction.residuals[i];
  return field;
}

Viewpoint viewpoint_of(const PhotoMeasurement& work, const Effective& effective) {
  const PhotoPose& pose = *work.camera.pose;
  const PlaneFit& sheet = work.sheet;
  Viewpoint v;
  v.name = "photograph";
  v.eye_mm = pose.eye_mm;
  v.eye_sigma_mm = pose.eye_sigma_mm;
  v.tilt_degrees = pose.tilt_degrees;
  v.effective_pitch_subpx = effective.estimates[0];
  v.slant = effective.estimates[1];
  v.effective_offset_lenses = effective.estimates[2];
  v.contrast = median_contrast(sheet.blocks);
  v.covered = std::min(sheet.fringes.covered, 1.0);
  v.blocks = sheet.correction.used;
  v.rms_lenses = sheet.correction.rms_lenses;
  v.max_lenses = sheet.correction.max_lenses;
  v.reprojection_rms_px = pose.corner_rms_px * work.photo.averaged;
  v.residual = residual_field(sheet);
  return v;
}

/// Returns the variance of the phase at a panel point, for an eye at the estimated camera position,
/// that results from the uncertainty of this position.
double variance_of_place(const PhotoMeasurement& work, const optics::OpticalModel& model,
                         Vec2 panel_px) {
  const Vec3 e = work.camera.pose->eye_mm;
  const auto phase = [&](double x, double y, double z) {
    return model.phase(panel_px.x, panel_px.y, kGreen, {e.x + x, e.y + y, e.z + z});
  };
  const std::array<double, 3> slopes = {0.5 * (phase(1, 0, 0) - phase(-1, 0, 0)),
                                        0.5 * (phase(0, 1, 0) - phase(0, -1, 0)),
                                        0.5 * (phase(0, 0, 1) - phase(0, 0, -1))};
  double variance = 0.0;
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j)
      variance += slopes[i] * slopes[j] * work.camera.pose->doubted_eye[3 * i + j];
  return variance;
}

/// Returns the drift for this eye only, since the result is valid only there. With `placed`, the
/// eye is put at the measured millimetres; otherwise the eye is at the true position of the camera.
DriftPrediction drift_of(const PhotoMeasurement& work, bool placed) {
  const Matrix3 c = plane_covariance(work);
  const optics::OpticalModel model(work.sheet.rig);
  DriftPrediction worst;
  worst.eye_mm = work.camera.pose->eye_mm;
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5}) {
      double variance = c[0][0] + x * x * c[1][1] + y * y * c[2][2] +
                        2.0 * (x * c[0][1] + y * c[0][2] + x * y * c[1][2]);
      const optics::Panel& panel = work.sheet.rig.panel;
      if (placed)
        variance += variance_of_place(work, model,
                                      {(x + 0.5) * panel.width_px, (y + 0.5) * panel.height_px});
      const double off = 2.0 * std::sqrt(std::max(variance, 0.0));
      if (off < worst.worst_lenses) continue;
      worst.worst_lenses = off;
      worst.panel_x_px = (x + 0.5) * work.sheet.rig.panel.width_px;
      worst.panel_y_px = (y + 0.5) * work.sheet.rig.panel.height_px;
    }
  }
  return worst;
}

void add_warnings(const PhotoMeasurement& work, const SinglePhotoChart& chart, bool confirmed,
                  Calibration& out) {
  const PlaneFit& sheet = work.sheet;
  const PhotoPose& pose = *work.camera.pose;
  if (work.camera.tags.size() < chart.tags.size())
    out.warnings.push_back(
        fmt::format("{} of {} tags were found", work.camera.tags.size(), chart.tags.size()));
  if (sheet.uneven_lenses > kEvenLenses)
    out.warnings.push_back(
        fmt::format("the sheet is not even: up to {:.3f} lenses, which the rig's map corrects for "
                    "this eye; {:.3f} remain",
                    sheet.uneven_lenses, sheet.correction.max_lenses));
  const size_t outliers = sheet.blocks.size() - static_cast<size_t>(sheet.correction.used);
  if (20 * outliers > sheet.blocks.size())
    out.warnings.push_back(fmt::format("{} of {} blocks did not fit and were left out", outliers,
                                       sheet.blocks.size()));
  if (const double sigma = pose.eye_sigma_mm.z; sigma > 0.03 * pose.eye_mm.z)
    out.warnings.push_back(
        fmt::format("the distance of the camera is known only to {:.0f} mm: straight ahead, focal "
                    "length and distance cannot be separated",
                    sigma));
  if (!work.squares)
    out.warnings.emplace_back(
        "it cannot be checked whether the chart was shown pixel by pixel: the picture is too "
        "small");
  const double there = drift_of(work, false).worst_lenses;
  if (out.drift.worst_lenses > std::max(kEvenLenses, 2.0 * there))
    out.warnings.push_back(
        fmt::format("phases are right to {:.3f} lens for an eye at the camera's place, but only to "
                    "{:.2f} for one at the stated distance: the picture does not show whether it "
                    "was cropped{}",
                    there, out.drift.worst_lenses,
                    confirmed ? ""
                              : ", nor confirm the distance; give both "
                                "--distance and --focal-px"));
}

}  // namespace

LensPlane effective_plane(const optics::Rig& rig, const Vec3& eye_mm) {
  const optics::Panel& panel = rig.panel;
  LensPlane plane = plane_of(rig);
  const double wider = 1.0 + rig.sheet.gap.value / eye_mm.z;
  plane.across /= wider;
  plane.down /= wider;
  const optics::OpticalModel model(rig);
  plane.at = model.phase(0.5 * panel.width_px, 0.5 * panel.height_px, kGreen,
                         {eye_mm.x, eye_mm.y, eye_mm.z});
  return plane;
}

void add_findings(const PhotoMeasurement& work, const SinglePhotoChart& chart,
                  const PhotoPriors& priors, Calibration& out) {
  const Effective effective = effective_of(work);
  const Vec3 eye = work.camera.pose->eye_mm;
  out.rig = work.sheet.rig;
  double& offset = out.rig.sheet.offset.value;
  offset -= std::round(offset);
  out.rig.viewing = {Millimetres(eye.y), Millimetres(eye.z)};
  out.viewpoints = {viewpoint_of(work, effective)};
  out.parameters = {{"effective_pitch_subpx", "subpixels", effective.estimates[0]},
                    {"slant", "px/px", effective.estimates[1]},
                    {"effective_offset_lenses", "lenses", effective.estimates[2]}};
  out.correlations = effective.correlations;
  out.drift = drift_of(work, true);
  out.verdict = Verdict::Effective;
  out.reasons = {
      "one photograph determines pitch and offset only for its place; the gap is that of the "
      "starting rig"};
  add_warnings(work, chart, priors.focal_px && priors.distance_mm, out);
}

void add_camera(const PhotoMeasurement& work, Calibration& out) {
  if (!work.camera.pose) return;
  const PhotoPose& pose = *work.camera.pose;
  out.camera.focal_px = pose.focal_px * work.photo.averaged;
  out.camera.centre_x_px = pose.middle_px.x * work.photo.averaged;
  out.camera.centre_y_px = pose.middle_px.y * work.photo.averaged;
  out.camera.k1 = -pose.distortion;
}

}  // namespace lenticule::calib
