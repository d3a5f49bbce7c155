// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-bench/models/studio.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/file.h"
#include "optics/vec.h"
#include "render/scene/surroundings.h"

namespace lenticule::bench {
namespace {

/// Appends a pixel with a shared exponent: value = mantissa / 256 * 2^(exponent - 128).
void append_rgbe(Vec3 light, std::string& bytes) {
  int exponent = 0;
  const double largest = std::max({light.x, light.y, light.z});
  const double scale = std::frexp(largest, &exponent) * 256.0 / largest;
  for (const double part : {light.x, light.y, light.z})
    bytes.push_back(static_cast<char>(static_cast<uint8_t>(part * scale)));
  bytes.push_back(static_cast<char>(static_cast<uint8_t>(exponent + 128)));
}

}  // namespace

void write_studio(const std::filesystem::path& file, int width, int height) {
  std::string bytes =
      fmt::format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n", height, width);
  for (int j = 0; j < height; ++j) {
    const double from_up = std::numbers::pi * (j + 0.5) / height;
    for (int i = 0; i < width; ++i) {
      const double azimuth = 2.0 * std::numbers::pi * ((i + 0.5) / width - 0.5);
      append_rgbe(Vec3{1, 1, 1} * render::studio_light({std::sin(from_up) * std::sin(azimuth),
                                                        std::cos(from_up),
                                                        -std::sin(from_up) * std::cos(azimuth)}),
                  bytes);
    }
  }
  write_text_file(file, bytes);
}

}  // namespace lenticule::bench
