// SPDX-License-Identifier: Apache-2.0
// Starts the joint fit of hand-held photographs, from the fits of the single photographs and the
// rig.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/calibration.h"
#include "calib/phone/phone_model.h"

namespace lenticule::calib {

inline constexpr double kGapSigma = 0.15;  ///< relative standard deviation of the gap's prior

/// PhoneStart holds all unknowns, in the order of PhoneModel.
struct PhoneStart {
  Eigen::VectorXd values;
  Eigen::VectorXd prior;  ///< means of the priors of camera and sheet
};

/// Returns the start of the fit. Tries gaps within 30 %: at the right one a single offset explains
/// the phases of all photographs up to whole lenses.
[[nodiscard]] PhoneStart phone_start(const PhoneModel& model,
                                     const std::vector<PhotoFindings>& photos,
                                     const optics::Rig& rig, const Estimate& focal_px);

}  // namespace lenticule::calib
