// SPDX-License-Identifier: Apache-2.0
// The measurement model for least squares: camera pixel -> ray -> lens plane -> panel point, in any
// number type, for automatic differentiation. Formulas as in docs/panel/optics.md; the camera is a
// pinhole with two coefficients of radial distortion.
#pragma once

#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "calib/measure/pattern.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// Indices of the camera's parameters in its block.
inline constexpr int kFocal = 0, kCentreX = 1, kCentreY = 2, kRadial1 = 3, kRadial2 = 4;
inline constexpr int kCameraCount = 5;
/// Indices of the block of one view's own camera: how far the camera differs there from the common
/// one, because it focused anew or its stabiliser moved the lens. The focal length as a fraction of
/// the common one, the principal point in parts of the picture's longer side.
inline constexpr int kOwnFocal = 0, kOwnCentreX = 1, kOwnCentreY = 2;
inline constexpr int kOwnCount = 3;
/// Standard deviations of a view's own camera: focus breathing, and the shift by a stabiliser in
/// parts of the picture's longer side.
inline constexpr double kOwnFocalSigma = 0.008, kOwnCentreSigma = 0.0012;
/// The pose block: rotation (angle-axis) from the panel's frame into the camera's, then the pupil
/// in the panel's frame, mm. Camera frame: x right, y down, z forward.
inline constexpr int kPupil = 3, kPoseCount = 6;
/// The sheet block: lenses per half panel width and, from the middle downward, per half height;
/// lens coordinate at the centre; reduced gap in mm; refraction shape. Then two values that only a
/// measurement needs, in gaps: the aberration of fringes, and the sag of the lenses, which is their
/// height from border to apex.
inline constexpr int kAcross = 0, kDown = 1, kOffset = 2, kGap = 3, kShape = 4, kAberration = 5,
                     kSag = 6;
inline constexpr int kSheetCount = 7;

template <class T>
struct PlanePoint {
  T x;
  T y;
};

/// Computes a view's camera from the common camera and the view's own block.
template <class T>
void camera_of_view(const T* camera, const T* own, double longer_px, T* out) {
  std::copy(camera, camera + kCameraCount, out);
  out[kFocal] = camera[kFocal] * (1.0 + own[kOwnFocal]);
  out[kCentreX] = camera[kCentreX] + longer_px * own[kOwnCentreX];
  out[kCentreY] = camera[kCentreY] + longer_px * own[kOwnCentreY];
}

/// Returns the direction of a camera pixel in the camera's frame, z = 1. Removes the distortion by
/// fixed-point steps, which converge to rounding for any lens usable for calibration.
template <class T, class Pixel>
PlanePoint<T> undistorted(const T* camera, const Pixel& u, const Pixel& v) {
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

/// Returns the point of the lens-apex plane, mm, that a camera sees in a direction of its frame.
template <class T>
PlanePoint<T> lens_plane_along(const T* pose, const T* in_camera) {
  const T back[3] = {-pose[0], -pose[1], -pose[2]};
  T along[3];
  ceres::AngleAxisRotatePoint(back, in_camera, along);
  const T* pupil = pose + kPupil;
  const T steps = -pupil[2] / along[2];
  return {pupil[0] + steps * along[0], pupil[1] + steps * along[1]};
}

/// Returns the point of the lens-apex plane, mm, that the camera pixel sees.
template <class T>
PlanePoint<T> lens_plane_point(const T* camera, const T* pose, double u, double v) {
  const PlanePoint<T> d = undistorted(camera, u, v);
  const T in_camera[3] = {d.x, d.y, T(1.0)};
  return lens_plane_along(pose, in_camera);
}

/// Returns the unit vector across the lenses, in the direction of a growing lens coordinate.
template <class T>
PlanePoint<T> across_lenses(const T* sheet, const optics::Panel& panel) {
  using std::sqrt;
  const T x = sheet[kAcross] / (panel.width_px * panel.pixel_width.value);
  const T y = -sheet[kDown] / (panel.height_px * panel.pixel_height.value);
  const T length = sqrt(x * x + y * y);
  return {x / length, y / length};
}

/// Returns Q = L - Delta, the middle of the light that reaches the pupil through lens point L.
template <class T>
PlanePoint<T> panel_point(const T* pose, const T* sheet, const PlanePoint<T>& lens) {
  using std::sqrt;
  const T* pupil = pose + kPupil;
  const T rx = pupil[0] - lens.x, ry = pupil[1] - lens.y;
  const T part =
      sheet[kGap] / sqrt(pupil[2] * pupil[2] + (1.0 - sheet[kShape]) * (rx * rx + ry * ry));
  return {lens.x - part * rx, lens.y - part * ry};
}

/// Returns the panel point of patterns much wider than a lens. Such patterns are means over whole
/// lenses, and a whole lens is the range between two visible borders. The borders are lower than
/// the apices by the sag, so from the side the middle between them is not at the apex. Along the
/// lenses no borders are visible, but light enters a lens, in the mean, a third of the sag below
/// its apex, and is not refracted before.
template <class T>
PlanePoint<T> wide_pattern_point(const T* pose, const T* sheet, const optics::Panel& panel,
                                 const PlanePoint<T>& lens) {
  const PlanePoint<T> middle = panel_point(pose, sheet, lens);
  const T x = lens.x - middle.x, y = lens.y - middle.y;
  const PlanePoint<T> across = across_lenses(sheet, panel);
  const T more_across = sheet[kSag] * (across.x * x + across.y * y);
  const T more_along = sheet[kSag] / 3.0 * (across.x * y - across.y * x);
  return {middle.x - more_across * across.x + more_along * across.y,
          middle.y - more_across * across.y - more_along * across.x};
}

/// Returns the panel point of the phase of fringes that repeat from lens to lens. Seen from the
/// side, the distribution of light under a lens is asymmetric, and the phase of such fine fringes
/// is not that of its middle. In traced cylinders of any index and cone the difference grows with
/// the seventh power of the tangent across the lens, with a relative error of about a tenth.
template <class T>
PlanePoint<T> fringe_point(const T* pose, const T* sheet, const optics::Panel& panel,
                           const PlanePoint<T>& lens) {
  const T* pupil = pose + kPupil;
  const PlanePoint<T> across = across_lenses(sheet, panel);
  const T tangent = (across.x * (pupil[0] - lens.x) + across.y * (pupil[1] - lens.y)) / pupil[2];
  const T cubed = tangent * tangent * tangent;
  const T aside = sheet[kGap] * sheet[kAberration] * cubed * cubed * tangent;
  const PlanePoint<T> middle = panel_point(pose, sheet, lens);
  return {middle.x - aside * across.x, middle.y - aside * across.y};
}

/// Returns lambda without the residual map.
template <class T>
T lens_coordinate(const T* sheet, const optics::Panel& panel, const PlanePoint<T>& lens) {
  const double half_width = 0.5 * panel.width_px * panel.pixel_width.value;
  const double half_height = 0.5 * panel.height_px * panel.pixel_height.value;
  return sheet[kAcross] * lens.x / half_width - sheet[kDown] * lens.y / half_height +
         sheet[kOffset];
}

/// Returns s / pitch of a fringe at a panel point, mm.
template <class T>
T fringe_turns(const Fringe& fringe, const optics::Panel& panel, const PlanePoint<T>& q) {
  const double per_px = 3.0 / fringe.pitch_subpx;
  return per_px * (q.x / panel.pixel_width.value - fringe.slant * q.y / panel.pixel_height.value);
}

}  // namespace lenticule::calib
