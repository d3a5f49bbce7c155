// SPDX-License-Identifier: Apache-2.0
// Computes a rig from the measurements of one or several viewpoints, or refuses with the reasons.
// docs/panel/calibration-method.md derives the method.
#pragma once

#include <optional>
#include <vector>

#include "calib/calibration.h"
#include "calib/measure/viewpoint.h"

namespace lenticule::calib {

/// Nearest and farthest eyes of the viewing zone, relative to the viewpoints' mean distance.
inline constexpr double kNearestEyes = 0.75, kFarthestEyes = 1.25;

struct CalibrateOptions {
  /// Relative standard deviation of the starting gap, from the quality of the sheet's data.
  double gap_tolerance = 0.5;
  int map_columns = 24;  ///< knots of the residual map; 0 = no map
  int map_rows = 14;
  /// Limits of the verdict, in lenses over the whole panel for every eye of the viewing zone.
  double most_drift_lenses = 0.02;     ///< predicted, two standard errors
  double most_held_out_lenses = 0.03;  ///< Viewpoint::predicted_lenses
  /// Half width of the viewing zone of the prediction: eyes at the viewpoints' mean distance, and
  /// at distances kNearestEyes and kFarthestEyes.
  double zone_half_width_mm = 250.0;
  /// Measured distances of the first viewpoints from the panel, in their order; a value of 0 is
  /// unknown. The fit uses them if they agree with its result without them, else the calibration is
  /// refused.
  std::vector<Estimate> distances_mm{};
  /// Known focal length. The fit does not use it; the result must agree with it.
  std::optional<Estimate> focal_px{};
};

/// Computes the calibration. Never throws for measured data: untrustworthy data are refused with
/// reasons. Takes one to a few seconds.
[[nodiscard]] Calibration calibrate(const std::vector<ViewpointMeasurement>& viewpoints,
                                    const optics::Rig& start, const CalibrateOptions& options);

}  // namespace lenticule::calib
