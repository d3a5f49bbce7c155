// SPDX-License-Identifier: Apache-2.0
// Where the camera of a single photograph stood, and which place of the sheet and of the panel each
// of its pixels looks at.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "calib/calibration.h"
#include "calib/photo/tag_chart.h"
#include "calib/photo/tag_finder.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// What one pixel looks at, in panel pixels (X right, Y down).
struct SheetPoint {
  Vec2 lens_px;   ///< L, on the lens-apex plane
  Vec2 panel_px;  ///< Q = L - Delta(L, E), what the eye sees there
};

/// A camera with its optical axis near the middle of its picture and one term of distortion: a
/// pixel at (u, v) focal lengths from the axis looks along (u, v) (1 + k (u^2 + v^2)).
struct PhotoPose {
  double focal_px = 0.0;
  double distortion = 0.0;                    ///< k
  Vec2 middle_px;                             ///< where the axis is
  std::array<double, 9> panel_from_camera{};  ///< rotation, row by row
  Vec3 eye_mm;                                ///< E
  Vec3 eye_sigma_mm;                          ///< standard errors, if what is believed holds
  /// Covariance of the eye, row by row, if nothing that the picture cannot contradict is sure: the
  /// axis may be a tenth of the longer side off the middle (a picture that was cropped), a distance
  /// or a focal length that nothing else confirms a tenth off.
  std::array<double, 9> doubted_eye{};
  /// How far the beliefs are from the fit, in their standard errors together.
  double belief_pull = 0.0;
  double axis_pull = 0.0;     ///< the same of the axis in the middle of the picture
  double tags_larger = 0.0;   ///< the part of their size by which blur makes tags look larger
  double tilt_degrees = 0.0;  ///< between the axis and the panel's normal
  double corner_rms_px = 0.0;
  std::vector<double> tag_off_px;  ///< per tag, in their order: the worst of its corners

  /// Empty where the pixel looks past the panel's plane.
  [[nodiscard]] std::optional<SheetPoint> look(Vec2 pixel, const optics::Rig& rig) const;
};

/// What is known about the camera beforehand, with its standard error.
struct PhotoPriors {
  std::optional<Estimate> focal_px;     ///< else 0.85 of the longer side within a factor of 1.5
  std::optional<Estimate> distance_mm;  ///< else the chart's viewing distance, within 10 %
};

/// Least squares over the tags' corners, which appear displaced by the sheet as the rig says. A
/// photograph from straight ahead cannot tell focal length from distance: there the priors decide,
/// and eye_sigma_mm says how little is known. Empty if it does not converge to a camera in front
/// of the panel. At least four tags, all of them the chart's.
[[nodiscard]] std::optional<PhotoPose> find_pose(const std::vector<TagSighting>& tags,
                                                 const SinglePhotoChart& chart, int width,
                                                 int height, const PhotoPriors& priors);

}  // namespace lenticule::calib
