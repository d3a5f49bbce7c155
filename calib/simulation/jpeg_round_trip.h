// SPDX-License-Identifier: Apache-2.0
// Simulates the JPEG compression of a camera. This is the simulation's sole wrapper of
// libjpeg-turbo.
#pragma once

#include <cstdint>
#include <vector>

namespace lenticule::calib {

/// Compresses (chroma at half width and height) and decompresses in place. `codes` are rows from
/// the top of 1 or 3 channels; quality 1 to 100. Returns false if the library fails.
[[nodiscard]] bool jpeg_round_trip(std::vector<uint8_t>& codes, int width, int height, int channels,
                                   int quality);

}  // namespace lenticule::calib
