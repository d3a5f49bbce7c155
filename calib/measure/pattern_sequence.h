// SPDX-License-Identifier: Apache-2.0
// Lists the patterns of the measurement of one viewpoint, in their order.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "calib/measure/geometry.h"
#include "calib/measure/pattern.h"
#include "optics/rig.h"

namespace lenticule::calib {

struct MeasureOptions {
  std::string name = "centre";
  /// True if the link and the lens spot are measured too; once per calibration is enough.
  bool link_and_spot = true;
  /// False if patterns cannot depend on earlier pictures (photographs): the patterns are those of
  /// photo_patterns(), the fringes have the starting pitch, and aliases cannot be detected.
  bool adaptive = true;
};

/// Numbers of phase steps of the fringes: at the starting pitch, at its multiples, for the phases
/// of each colour, and for green's repetition at the end.
inline constexpr int kCoarseSteps = 8, kAliasSteps = 4, kFineSteps = 8, kRepeatSteps = 4;
inline constexpr int kSpotBins = 16;  ///< combs for the lens spot
/// Green comes first: its line is kept, and the longer the time until green is repeated, the more
/// of a drift is detected.
inline constexpr std::array<int, 3> kChannelOrder = {1, 2, 0};

/// Returns the levels of the wide waves along one axis.
[[nodiscard]] std::array<WaveLevel, 3> levels_of(const optics::Rig& rig, bool vertical);

/// Returns the first patterns: the dark panel with marks 0, 1 and 2, and the white panel.
[[nodiscard]] std::vector<Pattern> locating_patterns();

/// Returns the number of patterns of a measurement, for progress; a start that is an alias needs
/// more.
[[nodiscard]] int pattern_count(const MeasureOptions& options);

/// Returns the patterns of a measurement that is not adaptive, in their order and with their marks:
/// the patterns to be photographed, one picture each.
[[nodiscard]] std::vector<Pattern> photo_patterns(const optics::Rig& start);

}  // namespace lenticule::calib
