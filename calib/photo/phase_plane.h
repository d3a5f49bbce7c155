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

// Computes the sheet's residual map from the residuals of a plane fit.

/// Returns a residual map of 13 by 8 knots that smooths -residuals[i] of each block. Every knot is
/// the value of a plane fitted to the blocks around it; near blocks get a larger weight, outliers a
/// smaller one, and knots on the panel's border extrapolate the sheet. Returns an empty map for
/// fewer than 100 blocks.
[[nodiscard]] optics::ResidualMap smooth_map(const std::vector<FringeBlock>& blocks,
                                             const std::vector<double>& residuals);

/// Returns the sum of both maps, with as many knots as the finer map; between its knots the coarser
/// map is interpolated as in the optical model. Either map may be empty.
[[nodiscard]] optics::ResidualMap sum_of_maps(const optics::ResidualMap& a,
                                              const optics::ResidualMap& b);

}  // namespace lenticule::calib
