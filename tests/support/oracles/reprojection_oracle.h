// SPDX-License-Identifier: Apache-2.0
// Reference implementation of re-projection between lenses, slow and simple: double precision, one
// subpixel at a time, rays by OpticalModel::ray, no tiles and no columns.
#pragma once

#include <vector>

#include "optics/model.h"

namespace lenticule::test {

/// The point that a subpixel shows, as its tracer found it.
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
  /// Margin of the decision against rounding errors: small if the decision is close.
  double margin = 1.0;
};

struct OracleRules {
  double steepest = 4.0;
  double agreement = 16.0;
};

/// Finds the point that pixel `target` shows among the points under `lens`, in one row and channel;
/// `points[i]` is the point of pixel i. Every two neighbours under the lens form a chord. The
/// target shows the chord that its ray crosses nearest to the eye. The result is known only if the
/// ends of that chord belong to the same surface.
[[nodiscard]] FoundPoint oracle_on_chords(const optics::OpticalModel& model, int row, int channel,
                                          const std::vector<SeenPoint>& points, int target,
                                          long lens, const OracleRules& rules);

}  // namespace lenticule::test
