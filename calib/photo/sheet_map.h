// SPDX-License-Identifier: Apache-2.0
// Computes the sheet's residual map from the residuals of a plane fit.
#pragma once

#include <vector>

#include "calib/photo/fringe_blocks.h"
#include "calib/photo/phase_plane.h"

namespace lenticule::calib {

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
