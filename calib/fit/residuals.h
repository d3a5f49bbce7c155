// SPDX-License-Identifier: Apache-2.0
// The least-squares terms for Ceres. The caller owns a returned term and gives it to a problem.
#pragma once

#include <ceres/ceres.h>

#include "calib/fit/observations.h"

namespace lenticule::calib {

/// Makes a geometry term. Parameter blocks: camera, own camera, pose, sheet. Two residuals: the
/// panel point of the model at the camera pixel minus the decoded panel point, in standard errors.
[[nodiscard]] ceres::CostFunction* geometry_cost(const View& view, const GeometryPoint& point,
                                                 const optics::Panel& panel);

/// Makes a phase term. Parameter blocks: camera, own camera, pose, sheet, and one number for each
/// knot weight.
/// One residual: the observed phase minus the model's, without whole turns, in standard errors.
[[nodiscard]] ceres::CostFunction* phase_cost(const View& view, const PhaseObservation& seen,
                                              const optics::Panel& panel,
                                              const std::vector<KnotWeight>& knots);

/// Makes a linear term. Parameter blocks: one number for each weight. One residual: their weighted
/// sum, over sigma.
[[nodiscard]] ceres::CostFunction* linear_cost(const std::vector<double>& weights, double sigma);

/// Adds weak priors that hold for any camera: focal length, centre, little distortion.
void add_camera_priors(ceres::Problem& problem, const View& view, double* camera);

/// Adds the priors of a view's own camera, with standard deviations that are larger by a factor.
void add_own_camera_priors(ceres::Problem& problem, double* own, double factor = 1.0);

}  // namespace lenticule::calib
