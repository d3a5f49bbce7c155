// SPDX-License-Identifier: Apache-2.0
// Fits the camera's poses to the panel points that it saw, then all views together: lens sheet,
// residual map, camera and poses in one robust least-squares fit.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "calib/calibration.h"
#include "calib/fit/gap_search.h"
#include "calib/fit/observations.h"

namespace lenticule::calib {

/// Fits the camera's positions and optics to the panel points that all views saw; the sheet is
/// held. Starts from the homographies of the views, with
/// several focal lengths. Returns nothing if no camera fits. If all views face the panel squarely,
/// a weak prior of 0.9 picture widths determines the focal length.
[[nodiscard]] std::optional<PoseFit> fit_poses(const std::vector<View>& views,
                                               const SheetParameters& sheet,
                                               const optics::Panel& panel,
                                               CameraSameness sameness = CameraSameness::Same);

struct JointOptions {
  KnotGrid grid{.columns = 24, .rows = 14};
  bool free_gap = true;    ///< else the starting gap and shape are held
  bool free_poses = true;  ///< else the starting poses and cameras are held
  CameraSameness sameness = CameraSameness::Same;
  /// With CameraSameness::Nearly: the only view whose camera may differ, by any amount.
  std::optional<size_t> only_view{};
  /// Measured distances of the first views from the panel; a value of 0 is unknown.
  std::vector<Estimate> distances_mm{};
  /// Prior standard deviation of the map's second differences, lenses.
  double bend_sigma = 0.04;
  /// Factor on the standard errors of geometry points relative to their scatter: above 1 if errors
  /// of neighbouring points are correlated.
  double geometry_scatter = 1.0;
  int most_rounds = 40;
};

struct JointFit {
  FitValues values;
  /// Cost with the standard errors that the observations state, for comparing fits.
  double cost = 0.0;
  double phase_rms = 0.0;        ///< lenses
  double geometry_rms_px = 0.0;  ///< panel pixels
  /// Ratio of the phases' scatter to the scatter inside the blocks.
  double phase_scale = 1.0;
  /// Covariance of sheet, knots and poses in this order (kSheetCount + knots + 6 per view); rows of
  /// gap and shape are zero if they were held. Empty if the poses were held.
  Eigen::MatrixXd covariance;
  /// Phase residual at each phase observation of each view, lenses.
  std::vector<std::vector<double>> rests;
};

/// Returns the fit; empty if it does not converge.
///
/// Lifetime: `views` must outlive the call.
[[nodiscard]] std::optional<JointFit> fit_jointly(const std::vector<View>& views,
                                                  const PoseFit& poses, const SheetStart& start,
                                                  const std::optional<GapCandidate>& gap,
                                                  const optics::Panel& panel,
                                                  const JointOptions& options);

/// Returns the phase residuals of a view that the fit did not use, without whole lenses.
[[nodiscard]] std::vector<double> rests_of(const View& view, const OwnCameraValues& own,
                                           const PoseValues& pose, const FitValues& values,
                                           const KnotGrid& grid, const optics::Panel& panel);

}  // namespace lenticule::calib
