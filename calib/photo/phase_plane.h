// SPDX-License-Identifier: Apache-2.0
// From the phases of fringe blocks to pitch, slant and offset.
#pragma once

#include <array>
#include <vector>

#include "calib/photo/fringe_blocks.h"

namespace lenticule::calib {

/// What must be added to the lens plane that blocks were measured against.
struct PlaneCorrection {
  LensPlane add;
  /// Covariance of add.at, add.across and add.down, row by row, from the scatter of the blocks.
  std::array<double, 9> covariance{};
  std::vector<double> residuals;  ///< per block, lenses: phase left over
  double rms_lenses = 0.0;        ///< weighted, of blocks that are not outliers
  double max_lenses = 0.0;        ///< of the same
  int used = 0;                   ///< blocks that are not outliers
};

/// The plane under which the phasors of all blocks add up to the most: right to a fraction of a
/// fringe, when the start was right to a fringe and a half across the panel.
[[nodiscard]] LensPlane search_plane(const std::vector<FringeBlock>& blocks);

/// Robust weighted least squares of the blocks' phases, which must be within half a fringe, over
/// the plane and over a smooth error of place (a cubic polynomial), which shifts the fringes of
/// each band as far as it is detuned. Needs 20 blocks, or nothing is used.
[[nodiscard]] PlaneCorrection fit_plane(const std::vector<FringeBlock>& blocks);

}  // namespace lenticule::calib
