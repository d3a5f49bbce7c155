// SPDX-License-Identifier: Apache-2.0
// Finds the pitch of the lenses by showing fringes: near the starting pitch, and at multiples of a
// pitch that may be an alias.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "calib/measure/fringe_phase.h"
#include "optics/panel.h"

namespace lenticule::calib {

/// Fraction of the light that waves or fringes must modulate.
inline constexpr double kLeastModulation = 0.03;

/// Fringes are the waves of a fringe pattern in camera pixels.
struct Fringes {
  Fringe fringe;
  std::vector<Complex> waves;
  double contrast = 0.0;
};

/// FringeTrials shows fringes.
///
/// Lifetime: must not outlive the panel and the points.
struct FringeTrials {
  const optics::Panel& panel;
  const std::vector<Vec2>& panel_points;  ///< points of the pixels whose waves `show` returns
  /// Shows fringes in a number of phase steps.
  std::function<Fringes(double pitch_subpx, double slant, int steps)> show;
};

struct FoundFringes {
  Fringes fringes;
  FringePeak peak;
};

/// Returns the fringes of the first pitch that shows some: the nominal one or, if `tries_others`,
/// a small multiple or fraction of it.
[[nodiscard]] std::optional<FoundFringes> search_pitch(const FringeTrials& trials,
                                                       double nominal_pitch_subpx, double slant,
                                                       bool tries_others);

/// AliasFreeLine is the line of the true pitch, and the factors by which the pitch was multiplied.
struct AliasFreeLine {
  LinearPhase line;
  std::vector<int> multiples;
};

/// Leaves aliases: fringes also appear at an integer fraction of the pitch, so multiples are tried
/// as long as fringes appear there. `first` is the fringes at which `line` was found.
[[nodiscard]] AliasFreeLine leave_aliases(const FringeTrials& trials, const LinearPhase& line,
                                          const FoundFringes& first);

}  // namespace lenticule::calib
