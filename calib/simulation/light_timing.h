// SPDX-License-Identifier: Apache-2.0
// How much of an exposure a panel that changes its frame still shows the old one, and how bright
// its backlight was meanwhile. Times in milliseconds.
#pragma once

namespace lenticule::calib {

/// Part of the light of an exposure [begin, begin + length] that is the old frame's: liquid crystal
/// that turns exponentially from `switched` on.
[[nodiscard]] double old_frame_part(double begin, double length, double switched,
                                    double time_constant);

/// Mean of a square wave over the exposure, relative to its long mean. It is on for the first
/// `duty` of each period; frequency in hertz, 0 = always 1.
[[nodiscard]] double backlight_mean(double begin, double length, double hertz, double duty);

}  // namespace lenticule::calib
