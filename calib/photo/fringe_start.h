// SPDX-License-Identifier: Apache-2.0
// Counts the fringes of a photographed chart from scratch, however wrong the starting pitch was.
#pragma once

#include "calib/photo/fringe_blocks.h"
#include "optics/vec.h"

namespace lenticule::calib {

/// What the spectrum says.
struct FringeCount {
  /// Lenses across and down the panel more than the chart's starting rig says, by whole numbers
  /// and a place between them at best.
  Vec2 more_lenses;
  /// How far the best answer stands out: its score over the median of all scores.
  double prominence = 0.0;
};

/// Below this prominence the answer is as good as chance.
inline constexpr double kLeastProminence = 25.0;

/// The change of pitch and slant under which both kinds of bands have the most fringes in their
/// spectrum: one alone could not tell fringes from fringes mirrored.
[[nodiscard]] FringeCount count_fringes(const FringeSamples& fringes,
                                        const SinglePhotoChart& chart);

}  // namespace lenticule::calib
