// SPDX-License-Identifier: Apache-2.0
// The sheet's own shape from what a plane leaves over.
#pragma once

#include <vector>

#include "calib/photo/fringe_blocks.h"
#include "calib/photo/phase_plane.h"

namespace lenticule::calib {

/// A residual map of 13 by 8 knots that smooths -residuals[i] of each block: every knot is the
/// value of a plane fitted to the blocks around it, nearer ones counting more and such as stand out
/// less, so that knots on the panel's border go on as the sheet does there. Needs 100 blocks, else
/// it is empty.
[[nodiscard]] optics::ResidualMap smooth_map(const std::vector<FringeBlock>& blocks,
                                             const std::vector<double>& residuals);

/// Both maps as one, with as many knots as the finer; between its knots the coarser one counts as
/// the optical model reads it. Either may be empty.
[[nodiscard]] optics::ResidualMap sum_of_maps(const optics::ResidualMap& a,
                                              const optics::ResidualMap& b);

}  // namespace lenticule::calib
