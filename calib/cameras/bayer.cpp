// SPDX-License-Identifier: Apache-2.0
#include "calib/cameras/bayer.h"

#include <cstddef>

#include "base/error.h"

namespace lenticule::calib {
namespace {

/// Returns the mirrored index beyond an edge: that inner neighbour has the filter of the missing
/// one.
int mirrored(int index, int count) {
  if (index < 0) return 1;
  return index < count ? index : count - 2;
}

/// Surroundings holds the neighbourhood of a mosaic pixel.
struct Surroundings {
  const float* above;
  const float* here;
  const float* below;
  int left;
  int x;
  int right;

  [[nodiscard]] float beside() const { return 0.5F * (here[left] + here[right]); }
  [[nodiscard]] float upright() const { return 0.5F * (above[x] + below[x]); }
  [[nodiscard]] float cross() const { return 0.5F * (beside() + upright()); }
  [[nodiscard]] float corners() const {
    return 0.25F * (above[left] + above[right] + below[left] + below[right]);
  }
};

void put_pixel(const Surroundings& at, bool red_column, bool red_row, float* rgb) {
  if (red_column == red_row) {  // pixel under a red or blue filter
    rgb[0] = red_row ? at.here[at.x] : at.corners();
    rgb[1] = at.cross();
    rgb[2] = red_row ? at.corners() : at.here[at.x];
    return;
  }
  rgb[0] = red_row ? at.beside() : at.upright();
  rgb[1] = at.here[at.x];
  rgb[2] = red_row ? at.upright() : at.beside();
}

}  // namespace

void interpolate_bayer(std::span<const float> mosaic, int width, int height, BayerOrder order,
                       std::span<float> rgb) {
  const size_t pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  LENTICULE_CHECK(width >= 2 && height >= 2 && mosaic.size() >= pixels && rgb.size() >= 3 * pixels);
  float* out = rgb.data();
  for (int y = 0; y < height; ++y) {
    const float* const above = &mosaic[static_cast<size_t>(mirrored(y - 1, height)) * width];
    const float* const here = &mosaic[static_cast<size_t>(y) * width];
    const float* const below = &mosaic[static_cast<size_t>(mirrored(y + 1, height)) * width];
    for (int x = 0; x < width; ++x, out += 3) {
      const Surroundings at{above, here, below, mirrored(x - 1, width), x, mirrored(x + 1, width)};
      put_pixel(at, (x & 1) == order.red_column, (y & 1) == order.red_row, out);
    }
  }
}

}  // namespace lenticule::calib
