// SPDX-License-Identifier: Apache-2.0
#include "calib/linear_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <limits>

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

SymmetricAxes axes_of_symmetric(const MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(a);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace lenticule::calib
