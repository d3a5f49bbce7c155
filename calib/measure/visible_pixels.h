// SPDX-License-Identifier: Apache-2.0
// Selects the camera pixels that see the panel well enough for measuring.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/measure/grey.h"

namespace lenticule::calib {

/// Returns the pixels whose light differs between a white and a dark panel by a large part of the
/// panel's typical difference, and that are clipped in neither picture. This excludes the
/// surroundings of the panel, reflections and dead areas.
[[nodiscard]] std::vector<uint32_t> visible_pixels(const GreyPicture& dark,
                                                   const GreyPicture& white);

/// Returns the fraction of a picture's pixels, for messages.
[[nodiscard]] double part_of(const std::vector<uint32_t>& pixels, const GreyPicture& picture);

/// Returns the mean light of the pixels.
[[nodiscard]] double mean_of(const GreyPicture& picture, const std::vector<uint32_t>& pixels);

}  // namespace lenticule::calib
