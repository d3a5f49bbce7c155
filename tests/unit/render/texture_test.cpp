// SPDX-License-Identifier: Apache-2.0
#include "render/scene/texture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace lenticule::render {
namespace {

/// Returns 2 x 2 texels.
Texture four_texels() {
  Texture texture;
  texture.width = 2;
  texture.height = 2;
  texture.rgba = {0, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, 1, 1, 1, 1, 1};
  return texture;
}

/// Interpolates the texels beside a coordinate by the definition.
double plainly(const Texture& texture, double u, double v, int channel) {
  const auto texel = [&](double column, double row) {
    const auto on = [](double i, int size, bool repeat, bool mirror) {
      const int period = mirror ? 2 * size : size;
      const double wrapped = i - period * std::floor(i / period);
      const double mirrored = wrapped < size ? wrapped : 2 * size - 1 - wrapped;
      return static_cast<size_t>(repeat ? mirrored : std::clamp(i, 0.0, size - 1.0));
    };
    const size_t x = on(column, texture.width, texture.repeat_u, texture.mirror_u);
    const size_t y = on(row, texture.height, texture.repeat_v, texture.mirror_v);
    const size_t at = y * static_cast<size_t>(texture.width) + x;
    return double{texture.rgba[4 * at + static_cast<size_t>(channel)]};
  };
  const auto inside = [](double c, bool repeat) { return repeat ? c : std::clamp(c, 0.0, 1.0); };
  const double x = inside(u, texture.repeat_u) * texture.width - 0.5;
  const double y = inside(v, texture.repeat_v) * texture.height - 0.5;
  const double left = std::floor(x), top = std::floor(y);
  const double above = std::lerp(texel(left, top), texel(left + 1, top), x - left);
  const double below = std::lerp(texel(left, top + 1), texel(left + 1, top + 1), x - left);
  return std::lerp(above, below, y - top);
}

TEST(TextureValue, AgreesWithItsDefinition) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> any(-3.0, 4.0);
  for (int round = 0; round < 2000; ++round) {
    Texture texture;
    texture.width = 1 + static_cast<int>(random() % 5);
    texture.height = 1 + static_cast<int>(random() % 5);
    texture.repeat_u = random() % 2 == 0;
    texture.repeat_v = random() % 2 == 0;
    texture.mirror_u = texture.repeat_u && random() % 2 == 0;
    texture.mirror_v = texture.repeat_v && random() % 2 == 0;
    for (int n = 0; n < 4 * texture.width * texture.height; ++n)
      texture.rgba.push_back(static_cast<float>(random() % 256) / 255.0F);
    const double u = round % 7 == 0 ? std::round(any(random)) : any(random);
    const double v = round % 5 == 0 ? -1e-20 : any(random);
    for (const int channel : {0, 1, 2})
      ASSERT_NEAR(texture_value(texture, u, v, channel), plainly(texture, u, v, channel), 1e-9)
          << u << ' ' << v << ", " << texture.width << " x " << texture.height;
  }
}

TEST(TextureValue, ToleratesNonFiniteCoordinates) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_TRUE(std::isfinite(texture_value(four_texels(), bad, bad, 0)));
}

}  // namespace
}  // namespace lenticule::render
