// SPDX-License-Identifier: Apache-2.0
// Adds prior knowledge about phones, hands and lens sheets to the joint fit of hand-held
// photographs.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/phone/normal_equations.h"
#include "calib/phone/phone_model.h"

namespace lenticule::calib {

/// PhonePriors holds the priors that the fit does not state itself.
struct PhonePriors {
  Eigen::VectorXd means;     ///< values of camera and sheet, in the order of PhoneModel
  double focal_sigma = 0.0;  ///< standard deviation of the focal length, pixels
  /// Standard deviations of the rotation of the hand while the rows of each photograph are read,
  /// radians.
  std::vector<double> turn_sigmas;
};

/// Adds the residuals of the priors at `values`.
void add_phone_priors(const PhoneModel& model, const PhonePriors& priors,
                      const Eigen::VectorXd& values, NormalEquations& normal);

}  // namespace lenticule::calib
