// SPDX-License-Identifier: Apache-2.0
// Computes the contributions to an exposure while a panel changes its frame: the light of the old
// frame, and the mean brightness of the backlight. Times in milliseconds.
#pragma once

namespace lenticule::calib {

/// Returns the fraction of the light of an exposure [begin, begin + length] that belongs to the old
/// frame, for a liquid crystal that switches exponentially from `switched` on.
[[nodiscard]] double old_frame_part(double begin, double length, double switched,
                                    double time_constant);

/// Returns the mean of a square wave over the exposure, relative to its long-term mean. The wave is
/// on for the first `duty` of each period; frequency in hertz, 0 = always 1.
[[nodiscard]] double backlight_mean(double begin, double length, double hertz, double duty);

}  // namespace lenticule::calib
