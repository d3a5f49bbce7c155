// SPDX-License-Identifier: Apache-2.0
// Searches the gap. Views from different sides see phases that differ by the gap times their
// distance, but each phase is known only up to whole lenses, so several gaps fit about equally
// well. The search tries all combinations of whole numbers: for a given combination the remaining
// problem is linear.
#pragma once

#include <vector>

#include "calib/fit/observations.h"

namespace lenticule::calib {

struct GapCandidate {
  std::vector<int> whole_lenses;  ///< added to the phase of each view; 0 for the first
  double gap_mm = 0.0;
  double shape = 0.0;
  double rms_lenses = 0.0;
  /// Sum of squares divided by the variance of the best candidate's residuals, priors included.
  double chi_squared = 0.0;
};

/// Returns the candidates, best first, one for each plausible combination. Needs at least two
/// views.
[[nodiscard]] std::vector<GapCandidate> search_gaps(const std::vector<View>& views,
                                                    const PoseFit& poses, const SheetStart& start,
                                                    const optics::Panel& panel);

}  // namespace lenticule::calib
