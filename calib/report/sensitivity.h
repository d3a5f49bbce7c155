// SPDX-License-Identifier: Apache-2.0
// How far the picture moves when something else moves: the seat, the room's temperature, a number
// of the rig.
#pragma once

#include <string>
#include <vector>

#include "optics/model.h"

namespace lenticule::calib {

/// What people can see at worst: the phase may be off by this many lenses.
inline constexpr double kVisiblePhaseLenses = 0.02;

/// A sheet of acrylic that is free to grow, against the glass of a panel: relative pitch per
/// kelvin.
inline constexpr double kPitchPerKelvin = 7e-5;

struct Sensitivity {
  std::string change;         ///< "1 K warmer"
  double worst_lenses = 0.0;  ///< largest change of the phase over the panel
  /// How much of it fits into kVisiblePhaseLenses, with its unit: "0.37 K". Proportional.
  std::string allowed;
};

/// What small changes of seat, temperature and rig do to the phase that an eye at `eye` sees,
/// largest over a grid that includes the panel's border. Differences of the exact model, the
/// panel's centre being where pitch and slant pivot. `eye.z_mm` is positive and finite. Throws
/// Error(Input) where OpticalModel does.
[[nodiscard]] std::vector<Sensitivity> sensitivities(const optics::Rig& rig,
                                                     const optics::Eye& eye);

}  // namespace lenticule::calib
