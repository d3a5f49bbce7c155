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
  /// How far the fringes stand out of what is there by chance: the geometric mean over the kinds of
  /// bands, those whose fringes cannot be seen under this answer counting as chance.
  double prominence = 0.0;
};

/// Below this prominence the answer is as good as chance.
inline constexpr double kLeastProminence = 6.0;

/// The change of pitch and slant, within 12 % of the lenses, under which all kinds of bands have
/// fringes in their spectrum: one alone could not tell fringes from fringes mirrored.
[[nodiscard]] FringeCount count_fringes(const FringeSamples& fringes,
                                        const SinglePhotoChart& chart);

}  // namespace lenticule::calib
