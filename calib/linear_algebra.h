// SPDX-License-Identifier: Apache-2.0
// Decompositions of symmetric matrices, and priors of least-squares problems. Compiling one of
// Eigen's takes seconds, so that all calibration shares these.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace ceres {
class Problem;
}

namespace lenticule::calib {

/// Returns X with A X = B for a positive semidefinite A, by LDL^T. Columns of B are independent
/// right sides. The result is NaN if A is not finite or not positive semidefinite.
[[nodiscard]] Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// Returns the inverse of a positive definite matrix, by LDL^T.
[[nodiscard]] Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& a);

/// Returns the inverse of the normal equations of a least-squares problem at the present values:
/// the covariance of the parameters of `blocks`, in their order, without held parameters. A
/// parameter on which nothing depends has a variance of zero.
[[nodiscard]] Eigen::MatrixXd inverse_of_normal_equations(ceres::Problem& problem,
                                                          const std::vector<double*>& blocks);

/// Prior is the expectation of one unknown of a parameter block.
struct Prior {
  int at;
  double mean, sigma;
};

/// Adds a term (unknown - mean) / sigma for each prior to a block of `size` unknowns.
void add_priors(ceres::Problem& problem, double* block, int size, const std::vector<Prior>& priors);

/// Returns the correlations of values with this covariance; 0 between values of which one is exact.
[[nodiscard]] std::vector<std::vector<double>> correlations_of(const Eigen::MatrixXd& covariance);

/// SymmetricAxes holds the eigenvalues of a symmetric matrix, smallest first, and its normalised
/// eigenvectors in columns.
struct SymmetricAxes {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
[[nodiscard]] SymmetricAxes axes_of_symmetric(const Eigen::MatrixXd& a);

}  // namespace lenticule::calib
