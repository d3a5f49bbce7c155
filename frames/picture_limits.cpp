// SPDX-License-Identifier: Apache-2.0
#include "frames/picture_limits.h"

#include <fmt/format.h>

#include "base/error.h"
#include "frames/image_io.h"

namespace lenticule::frames {

void check_picture_size(const std::string& name, uint64_t width, uint64_t height,
                        uint64_t max_pixels) {
  const auto fail = [&](const std::string& cause) {
    throw Error(ErrorKind::Input, fmt::format("{}: {}", name, cause));
  };
  if (width < 1 || height < 1) fail("not a two-dimensional picture with pixels");
  if (width > kMaxImageSide || height > kMaxImageSide)
    fail(fmt::format("{} x {} pixels, the limit is {} per side", width, height, kMaxImageSide));
  if (width * height > max_pixels)
    fail(fmt::format("{} x {} pixels, the limit is {} million", width, height, max_pixels >> 20));
}

double plausible_pixel_aspect(double aspect) {
  constexpr double kMost = 16.0;
  return aspect > 1.0 / kMost && aspect < kMost ? aspect : 1.0;
}

}  // namespace lenticule::frames
