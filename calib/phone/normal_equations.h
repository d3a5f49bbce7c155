// SPDX-License-Identifier: Apache-2.0
// NormalEquations sums up the dense normal equations of a Gauss-Newton step, and solves them with
// Levenberg's damping.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace lenticule::calib {

/// NormalEquations holds sums over residuals in units of their standard deviations: the squares of
/// their derivatives, the gradient, and half the squared residuals.
struct NormalEquations {
  Eigen::MatrixXd square;
  Eigen::VectorXd gradient;
  double cost = 0.0;

  explicit NormalEquations(Eigen::Index size);

  /// Adds weight (rest + slope delta)^2 / 2, where delta are the changes of the unknowns at
  /// `places`; if `robust`, with Cauchy's loss at three standard errors.
  void add(const std::vector<Eigen::Index>& places, const std::vector<double>& slope, double rest,
           double sigma, bool robust);
  /// Adds the sums of other residuals of the same unknowns.
  NormalEquations& operator+=(const NormalEquations& other);

  /// Solves (square + damping diagonal) x = gradient, scaled to a unit diagonal.
  [[nodiscard]] Eigen::VectorXd solved(double damping) const;
  /// Returns the inverse of `square`, the covariance of the unknowns.
  [[nodiscard]] Eigen::MatrixXd inverse() const;
};

}  // namespace lenticule::calib
