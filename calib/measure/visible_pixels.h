// SPDX-License-Identifier: Apache-2.0
// The camera pixels that see the panel well enough to measure with.
#pragma once

#include <cstdint>
#include <vector>

#include "calib/measure/grey.h"

namespace lenticule::calib {

/// Pixels that are brighter with a white panel than with a dark one by a good part of what most of
/// the panel is, and clipped in neither picture: no room, no reflections, no dead areas.
[[nodiscard]] std::vector<uint32_t> visible_pixels(const GreyPicture& dark,
                                                   const GreyPicture& white);

/// Part of a picture's pixels, for messages.
[[nodiscard]] double part_of(const std::vector<uint32_t>& pixels, const GreyPicture& picture);

/// Mean light of the pixels.
[[nodiscard]] double mean_of(const GreyPicture& picture, const std::vector<uint32_t>& pixels);

}  // namespace lenticule::calib
