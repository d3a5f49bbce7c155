// SPDX-License-Identifier: Apache-2.0
// The part of Questions that needs Eigen, which the headers of calibration do not include.
#include "calib/by_eye/questions.h"

#include <Eigen/Core>

#include "calib/linear_algebra.h"

namespace lenticule::calib {

Plane Ladders::plane() const {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  std::optional<double> first;
  for (size_t place = 0; place < kPlaces; ++place) {
    if (!is_known(place)) continue;
    const std::vector<Reading> group = agreeing(place);
    if (!first) first = group.front().lenses;
    for (const Reading& reading : group) {
      const Eigen::Vector3d at(1.0, kPositions.at(place).x, reading.y);
      const double lenses = *first + optics::without_whole_lenses(reading.lenses - *first);
      // Every place has the same weight.
      normal += at * at.transpose() / static_cast<double>(group.size());
      right += at * lenses / static_cast<double>(group.size());
    }
  }
  if (!first) return {};
  if (known_places() < kLeastForPlane) return {.middle = *first, .across = 0.0, .down = 0.0};
  const Eigen::Vector3d solved = solve_symmetric(normal, right);
  return {.middle = solved.x(), .across = solved.y(), .down = solved.z()};
}

}  // namespace lenticule::calib
