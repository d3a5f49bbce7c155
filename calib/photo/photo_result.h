// SPDX-License-Identifier: Apache-2.0
// Computes a calibration, with standard errors and warnings, from the measurements of a single
// photograph.
#pragma once

#include <optional>

#include "calib/calibration.h"
#include "calib/photo/averaged_photo.h"
#include "calib/photo/camera_from_tags.h"
#include "calib/photo/plane_fit.h"

namespace lenticule::calib {

/// PhotoMeasurement holds all intermediate results, so that a refusal can report the progress.
struct PhotoMeasurement {
  AveragedPhoto photo;
  TaggedCamera camera;
  std::optional<double> squares;  ///< light_of_squares
  PlaneFit sheet;
  /// Change of at, across and down if the camera was one standard error further away.
  LensPlane farther;
};

/// Returns the plane as the eye sees the sheet: over panel points, with the effective pitch as P
/// and the phase at the panel's centre as `at`.
[[nodiscard]] LensPlane effective_plane(const optics::Rig& rig, const Vec3& eye_mm);

/// Adds rig, viewpoint, parameters, drift, verdict and warnings of a photograph that is not
/// refused.
void add_findings(const PhotoMeasurement& work, const SinglePhotoChart& chart,
                  const PhotoPriors& priors, Calibration& out);

/// Adds the known values of the camera, also for a refusal.
void add_camera(const PhotoMeasurement& work, Calibration& out);

}  // namespace lenticule::calib
