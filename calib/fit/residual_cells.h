// SPDX-License-Identifier: Apache-2.0
// Averages a view's phase residuals over cells of the panel, for pictures and for the verdict.
#pragma once

#include <vector>

#include "calib/calibration.h"
#include "calib/fit/observations.h"

namespace lenticule::calib {

/// CellGrid is a grid of cells over which residuals are averaged.
struct CellGrid {
  int columns, rows;
  double least_blocks;  ///< a cell with fewer blocks has no value
};
inline constexpr CellGrid kPictureCells{48, 27, 1.0};   ///< cells of the report
inline constexpr CellGrid kEvaluatedCells{12, 7, 4.0};  ///< large enough that noise averages out

/// Returns the mean residuals of the cells, NaN for cells with too few blocks. `rests` has one
/// residual for each phase of the view, in lenses; `camera` is the camera of this view.
[[nodiscard]] PanelField mean_over_cells(const View& view, const PoseValues& pose,
                                         const CameraValues& camera,
                                         const std::vector<double>& rests,
                                         const optics::Panel& panel, const CellGrid& grid);

}  // namespace lenticule::calib
