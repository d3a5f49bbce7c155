// SPDX-License-Identifier: Apache-2.0
// All views together: lens sheet, residual map, camera and poses in one robust least-squares fit.
#pragma once

#include <Eigen/Dense>
#include <optional>

#include "calib/fit/gap_search.h"
#include "calib/fit/pose_fit.h"

namespace lenticule::calib {

struct JointOptions {
  KnotGrid grid{.columns = 24, .rows = 14};
  bool free_gap = true;    ///< else the starting gap and shape are held
  bool free_poses = true;  ///< else the poses are held where they start
  /// Standard deviation believed of the map's second differences, lenses.
  double bend_sigma = 0.04;
  /// By how much larger than their scatter the standard errors of geometry points are taken: more
  /// than 1 where errors of neighbours are alike.
  double geometry_scatter = 1.0;
  int most_rounds = 40;
};

struct JointFit {
  FitValues values;
  double phase_rms = 0.0;        ///< lenses
  double geometry_rms_px = 0.0;  ///< panel pixels
  /// By how much the phases' scatter exceeds what the blocks' own scatter says.
  double phase_scale = 1.0;
  /// Of sheet, knots and poses in this order (kSheetCount + knots + 6 per view); rows of gap and
  /// shape are zero where they were held. Empty where the poses were.
  Eigen::MatrixXd covariance;
  /// Phase left over at each phase observation of each view, lenses.
  std::vector<std::vector<double>> rests;
};

/// `views` outlive the call. Empty where the fit does not converge.
[[nodiscard]] std::optional<JointFit> fit_jointly(const std::vector<View>& views,
                                                  const PoseFit& poses, const SheetStart& start,
                                                  const std::optional<GapCandidate>& gap,
                                                  const optics::Panel& panel,
                                                  const JointOptions& options);

/// What a fit says about a view that it did not use: the phases left over there, less whole lenses.
[[nodiscard]] std::vector<double> rests_of(const View& view, const PoseValues& pose,
                                           const FitValues& values, const KnotGrid& grid,
                                           const optics::Panel& panel);

}  // namespace lenticule::calib
