// SPDX-License-Identifier: Apache-2.0
// Colours of a sensor under a Bayer mosaic of filters.
#pragma once

#include <span>

namespace lenticule::calib {

/// Where the first red pixel lies: column and row, 0 or 1 each.
struct BayerOrder {
  int red_column = 0;
  int red_row = 0;
};

/// Bilinear: a colour that a pixel has no filter for is the mean of its nearest neighbours that
/// have. `mosaic` holds width * height values of linear light, `rgb` takes three times as many.
/// Both sides at least 2. Any thread.
void interpolate_bayer(std::span<const float> mosaic, int width, int height, BayerOrder order,
                       std::span<float> rgb);

}  // namespace lenticule::calib
