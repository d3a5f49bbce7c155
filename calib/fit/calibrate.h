// SPDX-License-Identifier: Apache-2.0
// From the measurements of one or several viewpoints to a rig that may be trusted, or to the reason
// why not. docs/calibration.md derives what is done here.
#pragma once

#include <optional>
#include <vector>

#include "calib/calibration.h"
#include "calib/measure/viewpoint.h"

namespace lenticule::calib {

struct CalibrateOptions {
  /// Relative standard deviation of the starting gap: how well the sheet's data are known.
  double gap_tolerance = 0.5;
  int map_columns = 24;  ///< knots of the residual map; 0 = no map
  int map_rows = 14;
  /// Limits of the verdict, lenses over the whole panel for every eye of the viewing zone.
  double most_drift_lenses = 0.02;     ///< predicted, two standard errors
  double most_held_out_lenses = 0.03;  ///< Viewpoint::foretold_lenses
  /// The viewing zone that the prediction is for: eyes at the viewpoints' mean distance and a
  /// quarter nearer and farther, this far to the sides.
  double zone_half_width_mm = 250.0;
  /// What is known beforehand of the first viewpoint's distance and of the camera. Nothing is
  /// fitted to them: what is found must agree with them.
  std::optional<Estimate> distance_mm{};
  std::optional<Estimate> focal_px{};
};

/// Never throws for what was measured: what cannot be trusted is refused with reasons. Takes one to
/// a few seconds.
[[nodiscard]] Calibration calibrate(const std::vector<ViewpointMeasurement>& viewpoints,
                                    const optics::Rig& start, const CalibrateOptions& options);

}  // namespace lenticule::calib
