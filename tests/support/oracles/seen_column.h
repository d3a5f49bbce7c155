// SPDX-License-Identifier: Apache-2.0
// Finds the subpixel that a lens shows to an eye, from the model alone.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "optics/model.h"

namespace lenticule::optics {

/// Returns the pixel column of the subpixel of row j and `channel` that lens `lens` shows to the
/// eye (the nearest in phase), or -1 if the lens shows no subpixel of this panel.
[[nodiscard]] inline int seen_column(const OpticalModel& model, int64_t lens, int j, int channel,
                                     const Eye& eye) {
  const Panel& panel = model.rig().panel;
  const double wanted = static_cast<double>(lens);
  const double px_per_lens = model.rig().sheet.pitch.value / 3.0;
  // Phase grows along the row by almost exactly one lens per pitch, so this iteration converges
  // quickly.
  double x_px = panel.width_px / 2.0;
  for (int step = 0; step < 40; ++step) {
    const double missing = wanted - model.phase(x_px, j + 0.5, channel, eye);
    x_px += missing * px_per_lens;
    if (std::abs(missing) < 1e-9) break;
  }
  if (!(x_px >= 0.0 && x_px < panel.width_px)) return -1;

  const int around = static_cast<int>(x_px), window = panel.layout.name() == "cells" ? 6 : 2;
  int best = -1;
  double best_distance = std::numeric_limits<double>::infinity();
  for (int i = std::max(0, around - window); i < std::min(panel.width_px, around + window + 1);
       ++i) {
    const Vec2 q = panel.subpixel_centre_px(i, j, channel);
    const double distance = std::abs(model.phase(q.x, q.y, channel, eye) - wanted);
    if (distance < best_distance) {
      best = i;
      best_distance = distance;
    }
  }
  return best;
}

}  // namespace lenticule::optics
