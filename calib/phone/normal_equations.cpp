// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/normal_equations.h"

#include <cmath>

#include "calib/linear_algebra.h"

namespace lenticule::calib {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NormalEquations::NormalEquations(Index size)
    : square(MatrixXd::Zero(size, size)), gradient(VectorXd::Zero(size)) {}

void NormalEquations::add(const std::vector<Index>& places, const std::vector<double>& slope,
                          double rest, double sigma, bool robust) {
  const double scaled = rest / sigma;
  constexpr double kOutlier = 3.0;
  const double ratio = scaled / kOutlier;
  const double loss = robust ? 1.0 / (1.0 + ratio * ratio) : 1.0;
  cost += robust ? 0.5 * kOutlier * kOutlier * std::log1p(ratio * ratio) : 0.5 * scaled * scaled;
  const double weight = loss / (sigma * sigma);
  for (size_t a = 0; a < places.size(); ++a) {
    gradient[places[a]] += weight * slope[a] * rest;
    for (size_t b = 0; b < places.size(); ++b)
      square(places[a], places[b]) += weight * slope[a] * slope[b];
  }
}

NormalEquations& NormalEquations::operator+=(const NormalEquations& other) {
  square += other.square;
  gradient += other.gradient;
  cost += other.cost;
  return *this;
}

VectorXd NormalEquations::solved(double damping) const {
  const VectorXd scale = square.diagonal().array().max(1e-30).rsqrt();
  MatrixXd scaled = scale.asDiagonal() * square * scale.asDiagonal();
  scaled.diagonal().array() += damping;
  return scale.asDiagonal() * solve_symmetric(scaled, scale.asDiagonal() * gradient);
}

MatrixXd NormalEquations::inverse() const {
  const VectorXd scale = square.diagonal().array().max(1e-30).rsqrt();
  const MatrixXd scaled = scale.asDiagonal() * square * scale.asDiagonal();
  return scale.asDiagonal() * inverse_of_symmetric(scaled) * scale.asDiagonal();
}

}  // namespace lenticule::calib
