// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/single_photo.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "calib/photo/photo_result.h"

namespace lenticule::calib {
namespace {

/// Refuses scaled pictures. Scaling smears squares of one pixel to less light than they have. It
/// also scales the fringes, so that the fitted pitch would belong to another size.
Refusal evaluate_scale(PhotoMeasurement& work, const SinglePhotoChart& chart) {
  constexpr double kLeastSquares = 0.8;
  work.squares = light_of_squares(work.photo.light, *work.camera.pose, chart);
  if (!work.squares || *work.squares >= kLeastSquares) return std::nullopt;
  return fmt::format(
      "the chart was scaled before it was displayed: its squares of one pixel have {:.0f} % of the "
      "expected light; show it pixel by pixel",
      100.0 * *work.squares);
}

/// Repeats the fit for a camera that was further away: the sheet bends light more at a small
/// distance, and a photograph from straight ahead does not determine its own distance.
void try_farther(PhotoMeasurement& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  const PhotoLight& picture = work.photo.light;
  const PhotoPose& pose = *work.camera.pose;
  const double sigma = pose.eye_sigma_mm.z;
  if (!std::isfinite(sigma)) return;
  PhotoPriors farther = work.photo.scaled(priors);
  farther.focal_px.reset();
  farther.distance_mm = {pose.eye_mm.z + sigma, 0.01};
  const std::optional<PhotoPose> other =
      find_pose(work.camera.tags, chart, picture.width, picture.height, farther);
  if (!other) return;
  PlaneFit sheet = work.sheet;
  sheet.fringes = collect_fringes(picture, *other, chart);
  if (fit_phases(chart, sheet)) return;
  const LensPlane here = effective_plane(work.sheet.rig, pose.eye_mm);
  const LensPlane there = effective_plane(sheet.rig, other->eye_mm);
  work.farther = {there.at - here.at - std::round(there.at - here.at), there.across - here.across,
                  there.down - here.down};
}

Refusal measure_phases(PhotoMeasurement& work, const SinglePhotoChart& chart,
                       const PhotoPriors& priors) {
  if (Refusal refusal = locate_camera(work.photo, chart, priors, work.camera)) return refusal;
  if (Refusal refusal = evaluate_scale(work, chart)) return refusal;
  if (Refusal refusal = locate_fringes(work.photo.light, *work.camera.pose, chart, work.sheet))
    return refusal;
  if (Refusal refusal = fit_phases(chart, work.sheet)) return refusal;
  if (const auto problem = optics::find_problem(work.sheet.rig))
    return problem->key + " would be " + problem->cause;
  return std::nullopt;
}

Refusal measure(PhotoMeasurement& work, const SinglePhotoChart& chart, const PhotoPriors& priors) {
  if (Refusal refusal = measure_phases(work, chart, priors)) return refusal;
  try_farther(work, chart, priors);
  return std::nullopt;
}

}  // namespace

PhotoFindings measure_photo(const CameraPicture& photograph, const SinglePhotoChart& chart,
                            const PhotoPriors& priors) {
  PhotoMeasurement work;
  work.photo = average_down(photograph);
  work.sheet.rig = chart.start;
  PhotoFindings out;
  out.refusal = measure_phases(work, chart, priors).value_or("");
  out.averaged = work.photo.averaged;
  out.width = work.photo.light.width;
  out.height = work.photo.light.height;
  out.tags = std::move(work.camera.tags);
  out.pose = work.camera.pose;
  out.rig = std::move(work.sheet.rig);
  out.contrast = work.sheet.blocks.empty() ? 0.0 : median_contrast(work.sheet.blocks);
  out.blocks = std::move(work.sheet.blocks);
  out.columns = work.sheet.fringes.columns;
  out.rows = work.sheet.fringes.rows;
  out.covered = std::min(work.sheet.fringes.covered, 1.0);
  out.saturated = work.sheet.fringes.saturated;
  return out;
}

Calibration fit_single_photo(const CameraPicture& photograph, const SinglePhotoChart& chart,
                             const PhotoPriors& priors) {
  LENTICULE_CHECK(photograph.channels > 0 &&
                  photograph.light.size() == static_cast<size_t>(photograph.width) *
                                                 static_cast<size_t>(photograph.height) *
                                                 static_cast<size_t>(photograph.channels));
  const auto began = std::chrono::steady_clock::now();
  Calibration out;
  out.rig = chart.start;
  PhotoMeasurement work;
  work.photo = average_down(photograph);
  work.sheet.rig = chart.start;
  if (const Refusal refusal = measure(work, chart, priors)) {
    out.reasons = {*refusal};
  } else {
    add_findings(work, chart, priors, out);
  }
  add_camera(work, out);
  out.seconds_computing =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return out;
}

}  // namespace lenticule::calib
