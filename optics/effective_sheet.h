// SPDX-License-Identifier: Apache-2.0
// EffectiveSheet describes a sheet for systems without a viewing distance: the distance is folded
// into pitch and offset.
#pragma once

#include <cmath>

#include "optics/rig.h"

namespace lenticule::optics {

struct EffectiveSheet {
  Subpixels pitch;
  Lenses offset;
};

/// Returns the effective sheet of a rig. Paraxially, the eye at (Ex0, Ey, Z) sees the phase
/// 3 (x + m y) / (P (1 + g/Z)) + offset', so the slant does not change.
[[nodiscard]] inline EffectiveSheet effective_sheet(const Rig& rig) {
  const LensSheet& sheet = rig.sheet;
  const double z = rig.viewing.distance.value;
  if (std::isinf(z)) return {sheet.pitch, sheet.offset};
  const double gap = sheet.gap.value;
  const double moved = gap / (z + gap);
  const double right_px = moved * rig.viewing.centre.value / rig.panel.pixel_width.value;
  const double rise_px = moved * rig.viewing.height.value / rig.panel.pixel_height.value;
  return {.pitch = sheet.pitch * (1.0 + gap / z),
          .offset = Lenses(sheet.offset.value +
                           3.0 * (right_px - sheet.slant * rise_px) / sheet.pitch.value)};
}

/// Returns the phase without its whole lenses, in [-1/2, 1/2].
[[nodiscard]] inline double without_whole_lenses(double phase) {
  return phase - std::round(phase);
}

}  // namespace lenticule::optics
