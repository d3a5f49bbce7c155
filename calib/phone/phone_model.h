// SPDX-License-Identifier: Apache-2.0
// PhoneModel computes the residuals of hand-held photographs of the chart, from all unknowns of
// their joint fit, in any number type, for automatic differentiation.
#pragma once

#include <ceres/rotation.h>

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "calib/fit/observations.h"
#include "calib/fit/projection.h"
#include "calib/phone/phone_observations.h"

namespace lenticule::calib {

/// PhoneModel holds the observations of all photographs. The unknowns of the fit are one vector:
/// the blocks of camera and sheet (projection.h), the knots of the residual map, and one block for
/// each photograph.
///
/// Lifetime: must not outlive the chart. Thread safety: any thread.
class PhoneModel {
 public:
  /// Indices in the block of a photograph: the pose, its own camera, the enlargement of its tags,
  /// and the rotation from the first row read to the last.
  static constexpr int kOwn = kPoseCount, kBreathing = kOwn + kOwnFocal,
                       kShiftX = kOwn + kOwnCentreX, kShiftY = kOwn + kOwnCentreY,
                       kLarger = kOwn + kOwnCount, kTurn = kLarger + 1, kPhotoCount = kTurn + 3;

  PhoneModel(const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart);

  /// Returns the observations of each photograph.
  [[nodiscard]] const std::vector<PhoneObservations>& seen() const { return seen_; }
  [[nodiscard]] const KnotGrid& grid() const { return grid_; }
  [[nodiscard]] double longer_px() const { return longer_; }  ///< side of the pictures

  [[nodiscard]] Eigen::Index size() const { return photo_at(seen_.size()); }
  [[nodiscard]] static Eigen::Index knots_at() { return kCameraCount + kSheetCount; }
  /// Returns the index of the block of photograph n.
  [[nodiscard]] Eigen::Index photo_at(size_t n) const {
    return knots_at() + grid_.count() + kPhotoCount * static_cast<Eigen::Index>(n);
  }

  /// Returns the phase that the blocks of unknowns predict without the residual map, in turns, and
  /// the point of the lens-apex plane at which it is seen.
  template <class T>
  T phase_of(const T* camera, const T* sheet, const T* photo, const FringeSeen& seen,
             PlanePoint<T>& lens) const;
  /// Computes the difference of a corner from its place on the panel, in pixels of the picture.
  template <class T>
  void corner_rest(const T* camera, const T* sheet, const T* photo, const CornerSeen& seen,
                   double pixels_per_mm, T* out) const;

  /// Returns the weights of the knots at a point of the panel.
  [[nodiscard]] std::vector<KnotWeight> weights_at(double x_mm, double y_mm) const;
  /// Returns the residual map for the weights of a point, lenses.
  [[nodiscard]] static double map_at(const Eigen::VectorXd& values,
                                     const std::vector<KnotWeight>& weights);

  /// Returns the residual of a phase of photograph n without whole lenses.
  [[nodiscard]] double phase_rest(const Eigen::VectorXd& values, size_t n,
                                  const FringeSeen& seen) const;
  [[nodiscard]] std::vector<double> phase_rests(const Eigen::VectorXd& values, size_t n) const;
  /// Returns the residuals of all corners of photograph n: x and y of each, pixels.
  [[nodiscard]] std::vector<double> corner_rests(const Eigen::VectorXd& values, size_t n) const;

 private:
  template <class T>
  static PlanePoint<T> seen_point(const T* camera, const T* photo, Vec2 pixel, double row);
  [[nodiscard]] double row_of(Vec2 pixel) const { return pixel.y / height_ - 0.5; }

  const optics::Panel& panel_;
  double longer_;
  int height_;
  KnotGrid grid_{.columns = 13, .rows = 8};
  std::vector<PhoneObservations> seen_;
};

/// Returns the point of the lens-apex plane that a pixel sees. The rows are read one after the
/// other while the hand turns the camera; `row` is -1/2 for the first and 1/2 for the last.
template <class T>
PlanePoint<T> PhoneModel::seen_point(const T* camera, const T* photo, Vec2 pixel, double row) {
  const PlanePoint<T> d = undistorted(camera, pixel.x, pixel.y);
  const T* turn = photo + kTurn;
  const T in_camera[3] = {d.x + row * (turn[1] - turn[2] * d.y),
                          d.y + row * (turn[2] * d.x - turn[0]),
                          1.0 + row * (turn[0] * d.y - turn[1] * d.x)};
  const T back[3] = {-photo[0], -photo[1], -photo[2]};
  T along[3];
  ceres::AngleAxisRotatePoint(back, in_camera, along);
  const T* pupil = photo + kPupil;
  const T steps = -pupil[2] / along[2];
  return {pupil[0] + steps * along[0], pupil[1] + steps * along[1]};
}

template <class T>
T PhoneModel::phase_of(const T* camera, const T* sheet, const T* photo, const FringeSeen& seen,
                       PlanePoint<T>& lens) const {
  T own[kCameraCount];
  camera_of_view(camera, photo + kOwn, longer_, own);
  lens = seen_point(own, photo, seen.pixel, row_of(seen.pixel));
  return fringe_turns(seen.fringe, panel_, fringe_point(photo, sheet, panel_, lens)) -
         lens_coordinate(sheet, panel_, lens);
}

template <class T>
void PhoneModel::corner_rest(const T* camera, const T* sheet, const T* photo,
                             const CornerSeen& seen, double pixels_per_mm, T* out) const {
  T own[kCameraCount];
  camera_of_view(camera, photo + kOwn, longer_, own);
  const PlanePoint<T> lens = seen_point(own, photo, seen.pixel, row_of(seen.pixel));
  const PlanePoint<T> at = wide_pattern_point(photo, sheet, panel_, lens);
  out[0] = (at.x - seen.panel_mm.x - photo[kLarger] * seen.from_middle_mm.x) * pixels_per_mm;
  out[1] = (at.y - seen.panel_mm.y - photo[kLarger] * seen.from_middle_mm.y) * pixels_per_mm;
}

}  // namespace lenticule::calib
