// SPDX-License-Identifier: Apache-2.0
// Counts the fringes of a photographed chart from scratch, even if the starting pitch was wrong.
#pragma once

#include "calib/photo/fringe_blocks.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// FringeCount is the result of the spectrum.
struct FringeCount {
  /// Additional lenses across and down the panel, relative to the chart's starting rig; whole
  /// numbers, refined to a position between them.
  Vec2 more_lenses;
  /// Prominence of the fringes above chance level: the geometric mean over the kinds of bands; a
  /// kind whose fringes are not visible under this answer counts as chance level.
  double prominence = 0.0;
};

/// An answer below this prominence is not better than chance.
inline constexpr double kLeastProminence = 6.0;

/// Returns the change of pitch and slant, within 12 % of the lenses, under which all kinds of bands
/// have fringes in their spectrum: a single kind cannot distinguish fringes from mirrored fringes.
[[nodiscard]] FringeCount count_fringes(const FringeSamples& fringes,
                                        const SinglePhotoChart& chart);

}  // namespace lenticule::calib
