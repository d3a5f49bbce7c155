// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/phone_model.h"

#include <cmath>

namespace lenticule::calib {

using Eigen::VectorXd;

PhoneModel::PhoneModel(const std::vector<PhotoFindings>& photos, const SinglePhotoChart& chart)
    : panel_(chart.start.panel),
      longer_(std::max(photos[0].width, photos[0].height)),
      height_(photos[0].height) {
  for (const PhotoFindings& photo : photos) seen_.push_back(phone_observations(photo, chart));
}

std::vector<KnotWeight> PhoneModel::weights_at(double x_mm, double y_mm) const {
  return knot_weights(grid_, {panel_.x_px(x_mm), panel_.y_px(y_mm)}, panel_.width_px,
                      panel_.height_px);
}

double PhoneModel::map_at(const VectorXd& values, const std::vector<KnotWeight>& weights) {
  double sum = 0.0;
  for (const KnotWeight& w : weights) sum += w.weight * values[knots_at() + w.knot];
  return sum;
}

double PhoneModel::phase_rest(const VectorXd& values, size_t n, const FringeSeen& seen) const {
  PlanePoint<double> lens{};
  const double* camera = values.data();
  const double phase =
      phase_of<double>(camera, camera + kCameraCount, camera + photo_at(n), seen, lens);
  const double rest = seen.turns - phase + map_at(values, weights_at(lens.x, lens.y));
  return rest - std::round(rest);
}

std::vector<double> PhoneModel::phase_rests(const VectorXd& values, size_t n) const {
  std::vector<double> rests;
  for (const FringeSeen& seen : seen_[n].phases) rests.push_back(phase_rest(values, n, seen));
  return rests;
}

std::vector<double> PhoneModel::corner_rests(const VectorXd& values, size_t n) const {
  const double* camera = values.data();
  std::vector<double> rests;
  for (const CornerSeen& seen : seen_[n].corners) {
    double rest[2];
    corner_rest<double>(camera, camera + kCameraCount, camera + photo_at(n), seen,
                        seen_[n].pixels_per_mm, rest);
    rests.insert(rests.end(), rest, rest + 2);
  }
  return rests;
}

}  // namespace lenticule::calib
