// SPDX-License-Identifier: Apache-2.0
// Which gap? Views from different sides see phases that differ by the gap times their distance,
// but each only up to whole lenses, so that several gaps fit about as well. All combinations of
// whole numbers are tried: for given ones everything else is linear.
#pragma once

#include <vector>

#include "calib/fit/pose_fit.h"

namespace lenticule::calib {

struct GapCandidate {
  std::vector<int> whole_lenses;  ///< added to the phase of each view; 0 for the first
  double gap_mm = 0.0;
  double shape = 0.0;
  double rms_lenses = 0.0;
  /// Sum of squares over the variance that the best candidate leaves, beliefs included.
  double chi_squared = 0.0;
};

/// Best first; one entry for each combination worth a thought. Needs two views or more.
[[nodiscard]] std::vector<GapCandidate> search_gaps(const std::vector<View>& views,
                                                    const PoseFit& poses, const SheetStart& start,
                                                    const optics::Panel& panel);

}  // namespace lenticule::calib
