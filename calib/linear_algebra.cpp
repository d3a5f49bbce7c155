// SPDX-License-Identifier: Apache-2.0
#include "calib/linear_algebra.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <utility>

namespace lenticule::calib {

using Eigen::MatrixXd;

MatrixXd solve_symmetric(const MatrixXd& a, const MatrixXd& b) {
  const Eigen::LDLT<MatrixXd> decomposed(a);
  if (decomposed.info() != Eigen::Success)
    return MatrixXd::Constant(b.rows(), b.cols(), std::numeric_limits<double>::quiet_NaN());
  return decomposed.solve(b);
}

MatrixXd inverse_of_symmetric(const MatrixXd& a) {
  return solve_symmetric(a, MatrixXd::Identity(a.rows(), a.cols()));
}

MatrixXd inverse_of_normal_equations(ceres::Problem& problem, const std::vector<double*>& blocks) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = blocks;
  ceres::CRSMatrix jacobian;
  problem.Evaluate(options, nullptr, nullptr, nullptr, &jacobian);
  MatrixXd normal = MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
  std::vector<std::pair<int, double>> slopes;  // column and value of a row, without zeros
  for (size_t row = 0; row < static_cast<size_t>(jacobian.num_rows); ++row) {
    slopes.clear();
    for (auto k = static_cast<size_t>(jacobian.rows[row]);
         k < static_cast<size_t>(jacobian.rows[row + 1]); ++k)
      if (jacobian.values[k] != 0.0) slopes.emplace_back(jacobian.cols[k], jacobian.values[k]);
    for (const auto& [a, slope_a] : slopes)
      for (const auto& [b, slope_b] : slopes) normal(a, b) += slope_a * slope_b;
  }
  for (Eigen::Index k = 0; k < normal.rows(); ++k)
    if (!(normal(k, k) > 0.0)) normal(k, k) = 1e300;
  const Eigen::VectorXd scale = normal.diagonal().array().rsqrt();
  normal = scale.asDiagonal() * normal * scale.asDiagonal();
  const MatrixXd inverse = inverse_of_symmetric(normal);
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

void add_priors(ceres::Problem& problem, double* block, int size,
                const std::vector<Prior>& priors) {
  MatrixXd weights = MatrixXd::Zero(static_cast<Eigen::Index>(priors.size()), size);
  Eigen::VectorXd means = Eigen::VectorXd::Zero(size);
  for (size_t k = 0; k < priors.size(); ++k) {
    weights(static_cast<Eigen::Index>(k), priors[k].at) = 1.0 / priors[k].sigma;
    means[priors[k].at] = priors[k].mean;
  }
  problem.AddResidualBlock(new ceres::NormalPrior(weights, means), nullptr, block);
}

std::vector<std::vector<double>> correlations_of(const MatrixXd& covariance) {
  std::vector<std::vector<double>> correlations(static_cast<size_t>(covariance.rows()));
  for (Eigen::Index a = 0; a < covariance.rows(); ++a)
    for (Eigen::Index b = 0; b < covariance.rows(); ++b) {
      const double scale = std::sqrt(covariance(a, a) * covariance(b, b));
      correlations[static_cast<size_t>(a)].push_back(scale > 0.0 ? covariance(a, b) / scale
                                                     : a == b    ? 1.0
                                                                 : 0.0);
    }
  return correlations;
}

SymmetricAxes axes_of_symmetric(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(a);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace lenticule::calib
