// SPDX-License-Identifier: Apache-2.0
// Computes pitch, slant and offset from the phases of fringe blocks.
#pragma once

#include <array>
#include <vector>

#include "calib/photo/fringe_blocks.h"

namespace lenticule::calib {

/// PlaneCorrection is the correction of the lens plane that blocks were measured against.
struct PlaneCorrection {
  LensPlane add;
  /// Covariance of add.at, add.across and add.down, row by row, from the scatter of the blocks.
  std::array<double, 9> covariance{};
  std::vector<double> residuals;  ///< phase residual per block, lenses
  double rms_lenses = 0.0;        ///< weighted, of blocks that are not outliers
  double max_lenses = 0.0;        ///< largest residual of blocks that are not outliers
  int used = 0;                   ///< number of blocks that are not outliers
};

/// Returns the plane with the largest sum of the phasors of all blocks: accurate to a fraction of a
/// fringe if the start was accurate to one and a half fringes across the panel.
[[nodiscard]] LensPlane search_plane(const std::vector<FringeBlock>& blocks);

/// Fits the blocks' phases, which must be within half a fringe, by robust weighted least squares.
/// The unknowns are the plane and a smooth error of position (a cubic polynomial), which shifts the
/// fringes of each band in proportion to its detuning. Uses no block unless there are at least 20.
[[nodiscard]] PlaneCorrection fit_plane(const std::vector<FringeBlock>& blocks);

}  // namespace lenticule::calib
