// SPDX-License-Identifier: Apache-2.0
#include "calib/photo/sheet_map.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "calib/linear_algebra.h"
#include "optics/residual_spline.h"

namespace lenticule::calib {
namespace {

constexpr int kColumns = 13;
constexpr int kRows = 8;
constexpr size_t kLeastBlocks = 100;
// Relative to the panel's width and height: about the distance of knots.
constexpr double kReachX = 0.06;
constexpr double kReachY = 0.09;

/// Returns the value at (x, y) of the plane through the surrounding blocks.
double smoothed(const std::vector<FringeBlock>& blocks, const std::vector<double>& residuals,
                double x, double y) {
  constexpr double kOutlierLenses = 0.03;
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();
  for (int round = 0; round < 5; ++round) {
    Eigen::Matrix3d normal = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < blocks.size(); ++i) {
      const Eigen::Vector3d terms(1.0, (blocks[i].x - x) / kReachX, (blocks[i].y - y) / kReachY);
      const double off = (-residuals[i] - terms.dot(plane)) / kOutlierLenses;
      const double near = std::exp(-0.5 * (terms[1] * terms[1] + terms[2] * terms[2]));
      // No outlier is known in the first round.
      const double weight = near / (1.0 + (round > 0 ? off * off : 0.0));
      normal += weight * terms * terms.transpose();
      right -= weight * residuals[i] * terms;
    }
    plane = solve_symmetric(normal, right);
  }
  return plane[0];
}

}  // namespace

optics::ResidualMap smooth_map(const std::vector<FringeBlock>& blocks,
                               const std::vector<double>& residuals) {
  if (blocks.size() < kLeastBlocks) return {};
  optics::ResidualMap map{kColumns, kRows, {}};
  for (int r = 0; r < kRows; ++r)
    for (int c = 0; c < kColumns; ++c)
      map.lenses.push_back(
          smoothed(blocks, residuals, c / (kColumns - 1.0) - 0.5, r / (kRows - 1.0) - 0.5));
  return map;
}

optics::ResidualMap sum_of_maps(const optics::ResidualMap& a, const optics::ResidualMap& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  optics::ResidualMap sum{std::max(a.columns, b.columns), std::max(a.rows, b.rows), {}};
  // The maps are evaluated on a panel with as many pixels as there are steps between knots.
  const int width = std::max(sum.columns - 1, 1), height = std::max(sum.rows - 1, 1);
  const optics::ResidualSpline first(a, width, height), second(b, width, height);
  for (int r = 0; r < sum.rows; ++r)
    for (int c = 0; c < sum.columns; ++c)
      sum.lenses.push_back(first.at(c, r).lenses + second.at(c, r).lenses);
  return sum;
}

}  // namespace lenticule::calib
