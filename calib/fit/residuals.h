// SPDX-License-Identifier: Apache-2.0
// The least-squares terms, for Ceres. Those who ask own what they get and give it to a problem.
#pragma once

#include <ceres/ceres.h>

#include "calib/fit/observations.h"

namespace lenticule::calib {

/// Parameter blocks: camera, pose, sheet. Two residuals: the panel point that the model sees at the
/// camera pixel minus that which was decoded, in standard errors.
[[nodiscard]] ceres::CostFunction* geometry_cost(const GeometryPoint& point,
                                                 const optics::Panel& panel);

/// Parameter blocks: camera, pose, sheet, and one number for each knot weight. One residual: the
/// phase seen minus the model's, less whole turns, in standard errors.
[[nodiscard]] ceres::CostFunction* phase_cost(const PhaseObservation& seen, const Fringe& fringe,
                                              const optics::Panel& panel,
                                              const std::vector<KnotWeight>& knots);

/// Parameter blocks: one number for each weight. One residual: their weighted sum, over sigma.
[[nodiscard]] ceres::CostFunction* linear_cost(const std::vector<double>& weights, double sigma);

/// What is believed of any camera: focal length, centre, little distortion. Weak.
void add_camera_beliefs(ceres::Problem& problem, const View& view, double* camera);

}  // namespace lenticule::calib
