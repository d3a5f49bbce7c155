// SPDX-License-Identifier: Apache-2.0
// Re-projection between lenses once more, slow and obvious: double precision, one subpixel at a
// time, rays by OpticalModel::ray, no tiles and no columns.
#pragma once

#include <vector>

#include "optics/model.h"

namespace lenticule::testing {

/// What a subpixel shows, as its tracer found it.
struct SeenPoint {
  bool there = false;
  double z_mm = 0.0;
  double code = 0.0;
  int surface = 0;
};

struct FoundPoint {
  bool known = false;
  double z_mm = 0.0;
  double code = 0.0;
  /// How much of the decision rounding can turn: small where it is close.
  double margin = 1.0;
};

struct OracleRules {
  double steepest = 4.0;
  double agreement = 16.0;
};

/// One row and channel: `points[i]` is what pixel i shows. Looks for what pixel `target` shows
/// among the points under `lens`: every two neighbours there make a chord; the chord nearest to the
/// eye that the target's ray crosses decides, and only one between points that belong together
/// knows.
[[nodiscard]] FoundPoint oracle_on_chords(const optics::OpticalModel& model, int row, int channel,
                                          const std::vector<SeenPoint>& points, int target,
                                          long lens, const OracleRules& rules);

}  // namespace lenticule::testing
