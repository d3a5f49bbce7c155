// SPDX-License-Identifier: Apache-2.0
// Computes how far the picture moves when the seat, the room's temperature or a value of the rig
// changes.
#pragma once

#include <string>
#include <vector>

#include "optics/model.h"

namespace lenticule::calib {

/// Largest phase error, in lenses, that remains invisible.
inline constexpr double kVisiblePhaseLenses = 0.02;

/// Relative change of pitch per kelvin of a free sheet of acrylic on the panel.
inline constexpr double kPitchPerKelvin = 7e-5;

struct Sensitivity {
  std::string change;         ///< "1 K warmer"
  double worst_lenses = 0.0;  ///< largest change of the phase over the panel
  /// Amount of the change that gives kVisiblePhaseLenses, with its unit: "0.37 K". Proportional.
  std::string allowed;
};

/// Returns the effects of small changes of seat, temperature and rig on the phase that an eye at
/// `eye` sees, the largest over a grid that includes the panel's border. They are differences of
/// the exact model; pitch and slant pivot at the panel's centre. `eye.z_mm` is positive and finite.
/// Throws the Error(Input) of OpticalModel.
[[nodiscard]] std::vector<Sensitivity> sensitivities(const optics::Rig& rig,
                                                     const optics::Eye& eye);

}  // namespace lenticule::calib
