// SPDX-License-Identifier: Apache-2.0
// PhotoPose is the camera position of a single photograph; it gives the points of the sheet and of
// the panel that each pixel sees.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "calib/calibration.h"
#include "calib/photo/tag_chart.h"
#include "calib/photo/tag_finder.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// SheetPoint is the point that one pixel sees, in panel pixels (X right, Y down).
struct SheetPoint {
  Vec2 lens_px;   ///< L, on the lens-apex plane
  Vec2 panel_px;  ///< Q = L - Delta(L, E), the panel point that the eye sees there
};

/// PhotoPose is a camera with its optical axis near the middle of its picture and one distortion
/// term: a pixel at (u, v) focal lengths from the axis looks along (u, v) (1 + k (u^2 + v^2)).
struct PhotoPose {
  double focal_px = 0.0;
  double distortion = 0.0;                    ///< k
  Vec2 middle_px;                             ///< position of the axis
  std::array<double, 9> panel_from_camera{};  ///< rotation, row by row
  Vec3 eye_mm;                                ///< E, the camera's pupil in the panel frame
  Vec3 eye_sigma_mm;                          ///< standard errors, if the priors are correct
  /// Covariance of the eye, row by row, under weak priors for everything that the picture cannot
  /// contradict: the axis may be a tenth of the longer side off the middle (a cropped picture), and
  /// a distance or a focal length without other confirmation may be a tenth off.
  std::array<double, 9> doubted_eye{};
  /// Distance of the priors from the fit, in their joint standard errors.
  double prior_pull = 0.0;
  double axis_pull = 0.0;     ///< the same for the prior of the axis
  double tags_larger = 0.0;   ///< relative enlargement of the tags by blur
  double tilt_degrees = 0.0;  ///< angle between the axis and the panel's normal
  double corner_rms_px = 0.0;
  std::vector<double>
      tag_off_px;  ///< largest error of each tag's corners, in the order of the tags

  /// Returns the point that a pixel sees; nothing if the pixel looks past the panel's plane.
  [[nodiscard]] std::optional<SheetPoint> seen_point(Vec2 pixel, const optics::Rig& rig) const;
};

/// PhotoPriors holds prior knowledge about the camera, with its standard error.
struct PhotoPriors {
  std::optional<Estimate> focal_px;     ///< else 0.85 of the longer side within a factor of 1.5
  std::optional<Estimate> distance_mm;  ///< else the chart's viewing distance, within 10 %
};

/// Fits the pose by least squares to the tags' corners, which the sheet displaces according to the
/// rig. A photograph from straight ahead cannot separate focal length and distance: there the
/// priors decide, and eye_sigma_mm shows the uncertainty. Returns nothing if the fit does not
/// converge to a camera in front of the panel. Needs at least four tags, all of them the chart's.
[[nodiscard]] std::optional<PhotoPose> find_pose(const std::vector<TagSighting>& tags,
                                                 const SinglePhotoChart& chart, int width,
                                                 int height, const PhotoPriors& priors);

}  // namespace lenticule::calib
