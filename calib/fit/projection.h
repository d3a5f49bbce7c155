// SPDX-License-Identifier: Apache-2.0
// The measuring model for least squares: camera pixel -> ray -> lens plane -> panel point, in any
// number type, so that derivatives come with it. Formulas as in docs/optics.md; the camera is a
// pinhole with two coefficients of radial distortion.
#pragma once

#include <ceres/rotation.h>

#include <array>
#include <cmath>

#include "calib/measure/pattern.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// Where the numbers are in parameter blocks.
inline constexpr int kFocal = 0, kCentreX = 1, kCentreY = 2, kRadial1 = 3, kRadial2 = 4;
inline constexpr int kCameraCount = 5;
/// Rotation (angle-axis) from the panel's frame into the camera's, then the pupil in the panel's
/// frame, mm. Camera frame: x right, y down, z forward.
inline constexpr int kPupil = 3, kPoseCount = 6;
/// Lenses per half panel width and, from the middle downward, per half height; lens coordinate at
/// the centre; reduced gap in mm; refraction shape.
inline constexpr int kAcross = 0, kDown = 1, kOffset = 2, kGap = 3, kShape = 4;
inline constexpr int kSheetCount = 5;

template <class T>
struct PlanePoint {
  T x;
  T y;
};

/// The direction of a camera pixel in the camera's frame, z = 1: distortion undone by fixed-point
/// steps, which converge to rounding for any lens worth calibrating with.
template <class T>
PlanePoint<T> undistorted(const T* camera, double u, double v) {
  const T x = (u - camera[kCentreX]) / camera[kFocal];
  const T y = (v - camera[kCentreY]) / camera[kFocal];
  T ux = x, uy = y;
  for (int i = 0; i < 8; ++i) {
    const T r2 = ux * ux + uy * uy;
    const T factor = 1.0 + r2 * (camera[kRadial1] + camera[kRadial2] * r2);
    ux = x / factor;
    uy = y / factor;
  }
  return {ux, uy};
}

/// The point of the plane of the lens apices, mm, that the camera pixel looks at.
template <class T>
PlanePoint<T> lens_plane_point(const T* camera, const T* pose, double u, double v) {
  const PlanePoint<T> d = undistorted(camera, u, v);
  const T in_camera[3] = {d.x, d.y, T(1.0)};
  const T back[3] = {-pose[0], -pose[1], -pose[2]};
  T along[3];
  ceres::AngleAxisRotatePoint(back, in_camera, along);
  const T* pupil = pose + kPupil;
  const T steps = -pupil[2] / along[2];
  return {pupil[0] + steps * along[0], pupil[1] + steps * along[1]};
}

/// Q = L - Delta.
template <class T>
PlanePoint<T> panel_point(const T* pose, const T* sheet, const PlanePoint<T>& lens) {
  using std::sqrt;
  const T* pupil = pose + kPupil;
  const T rx = pupil[0] - lens.x, ry = pupil[1] - lens.y;
  const T part =
      sheet[kGap] / sqrt(pupil[2] * pupil[2] + (1.0 - sheet[kShape]) * (rx * rx + ry * ry));
  return {lens.x - part * rx, lens.y - part * ry};
}

/// lambda without the residual map.
template <class T>
T lens_coordinate(const T* sheet, const optics::Panel& panel, const PlanePoint<T>& lens) {
  const double half_width = 0.5 * panel.width_px * panel.pixel_width.value;
  const double half_height = 0.5 * panel.height_px * panel.pixel_height.value;
  return sheet[kAcross] * lens.x / half_width - sheet[kDown] * lens.y / half_height +
         sheet[kOffset];
}

/// s / pitch of a fringe at a panel point, mm.
template <class T>
T fringe_turns(const Fringe& fringe, const optics::Panel& panel, const PlanePoint<T>& q) {
  const double per_px = 3.0 / fringe.pitch_subpx;
  return per_px * (q.x / panel.pixel_width.value - fringe.slant * q.y / panel.pixel_height.value);
}

}  // namespace lenticule::calib
