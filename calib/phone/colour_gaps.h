// SPDX-License-Identifier: Apache-2.0
// Measures the gap of each colour of light: a sheet refracts blue light more than red.
#pragma once

#include <Eigen/Core>
#include <array>

#include "calib/calibration.h"
#include "calib/phone/phone_model.h"

namespace lenticule::calib {

/// Measures the gap of red, green and blue light, mm, at the fitted values, in the order of
/// PhoneModel. Phases move by the gap's change times their slope over it, so the colours'
/// differences from the mean of the channels show the differences of their gaps. `gap_sigma` is the
/// standard error of the fitted gap.
[[nodiscard]] std::array<Estimate, 3> colour_gaps(const PhoneModel& model,
                                                  const Eigen::VectorXd& values, double gap_sigma);

}  // namespace lenticule::calib
