// SPDX-License-Identifier: Apache-2.0
// Checks a picture's header before memory is allocated for its pixels.
#pragma once

#include <cstdint>
#include <string>

namespace lenticule::frames {

/// Throws Error(Input), beginning with `name`, if a side or the number of pixels is out of range.
void check_picture_size(const std::string& name, uint64_t width, uint64_t height,
                        uint64_t max_pixels);

/// Returns the aspect of a pixel that a header states as width by height; 1 if it is implausible.
[[nodiscard]] double plausible_pixel_aspect(double aspect);

}  // namespace lenticule::frames
