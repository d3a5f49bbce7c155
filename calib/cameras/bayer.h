// SPDX-License-Identifier: Apache-2.0
// Interpolates the colours of a sensor with a Bayer mosaic of filters.
#pragma once

#include <span>

namespace lenticule::calib {

/// BayerOrder is the position of the first red pixel: column and row, 0 or 1 each.
struct BayerOrder {
  int red_column = 0;
  int red_row = 0;
};

/// Interpolates bilinearly: a colour without a filter on a pixel is the mean of its nearest
/// neighbours with that filter. `mosaic` holds width * height values of linear light, `rgb` three
/// times as many. Both sides are at least 2.
///
/// Thread safety: any thread.
void interpolate_bayer(std::span<const float> mosaic, int width, int height, BayerOrder order,
                       std::span<float> rgb);

}  // namespace lenticule::calib
