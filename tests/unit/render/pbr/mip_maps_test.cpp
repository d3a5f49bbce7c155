// SPDX-License-Identifier: Apache-2.0
#include "render/textures/mip_maps.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "frames/srgb.h"
#include "render/scene/texture.h"

namespace lenticule::render {
namespace {

using enum texel_kernel::Content;

std::shared_ptr<Texture> codes(int width, int height,
                               const std::function<std::array<int, 4>(int, int)>& texel) {
  auto texture = std::make_shared<Texture>();
  texture->width = width;
  texture->height = height;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (const int code : texel(x, y)) texture->codes.push_back(static_cast<uint8_t>(code));
  return texture;
}

std::shared_ptr<Texture> noise(int width, int height) {
  auto generator = std::make_shared<std::mt19937>(5);
  return codes(width, height, [generator](int, int) {
    const auto code = [&] { return static_cast<int>((*generator)() % 256); };
    return std::array{code(), code(), code(), code()};
  });
}

std::shared_ptr<Texture> stripes() {
  return codes(64, 64, [](int x, int) {
    const int code = x % 2 == 0 ? 0 : 255;
    return std::array{code, code, code, 255};
  });
}

TEST(MipMaps, ReturnTheTextureItselfWithoutAFootprint) {
  const auto texture = noise(13, 7);
  for (const bool repeat : {true, false}) {
    texture->repeat_u = texture->repeat_v = repeat;
    const MipMaps maps(texture, Colour);
    for (double u = -1.3; u < 2.0; u += 0.37)
      for (double v = -0.9; v < 2.0; v += 0.29) {
        const MipMaps::Value value = maps.value({u, v}, {});
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(value[static_cast<size_t>(c)], texture_value(*texture, u, v, c), 1e-6);
      }
  }
}

TEST(MipMaps, AverageColoursAsLight) {
  const MipMaps maps(stripes(), Colour);
  const MipMaps::Value mean = maps.value({0.4, 0.7}, {.across = {1, 0}, .along = {0, 1}});
  EXPECT_NEAR(mean[0], 0.5, 0.005);
}

TEST(MipMaps, OverTheWholeTextureAreItsMean) {
  for (const auto& [width, height] : {std::pair{64, 64}, std::pair{37, 11}, std::pair{1, 50}}) {
    const auto texture = noise(width, height);
    double sum = 0.0;
    const auto texels = static_cast<size_t>(width * height);
    for (size_t n = 0; n < texels; ++n) sum += texture->codes[4 * n + 1] / 255.0;
    const MipMaps maps(texture, Data);
    const MipMaps::Value mean = maps.value({0.5, 0.5}, {.across = {4, 0}, .along = {0, 4}});
    EXPECT_NEAR(mean[1], sum / static_cast<double>(texels), 0.01) << width << " x " << height;
  }
}

TEST(MipMaps, HalvesAreTheMeansOfFourTexels) {
  constexpr int kWidth = 64, kHeight = 32;
  const auto texture = noise(kWidth, kHeight);
  const TextureFootprint two_texels{.across = {2.0 / kWidth, 0}, .along = {0, 2.0 / kHeight}};
  for (const MipMaps::Content content : {Colour, Data}) {
    const MipMaps maps(texture, content);
    for (int y = 0; y < kHeight; y += 2)
      for (int x = 0; x < kWidth; x += 2) {
        const MipMaps::Value value =
            maps.value({(x + 1.0) / kWidth, (y + 1.0) / kHeight}, two_texels);
        for (size_t c = 0; c < 4; ++c) {
          double mean = 0.0;
          for (const int at : {0, 1, kWidth, kWidth + 1}) {
            const uint8_t code = texture->codes[4 * static_cast<size_t>(y * kWidth + x + at) + c];
            mean += 0.25 * (content == Colour && c < 3 ? frames::linear_of_codes()[code]
                                                       : static_cast<double>(code) / 255.0);
          }
          // Half a code, which is more light the brighter it is.
          const bool is_light = content == Colour && c < 3;
          EXPECT_NEAR(value[c], mean, is_light ? 0.001 + 0.008 * mean : 0.5 / 255.0 + 1e-7);
        }
      }
  }
}

/// A footprint along stripes keeps them, one across blurs them.
TEST(MipMaps, FilterAlongTheFootprint) {
  const MipMaps maps(stripes(), Data);
  const double texel = 1.0 / 64;
  const Vec2 on_stripe{11.5 * texel, 0.3};
  const Vec2 narrow_x{0.5 * texel, 0.0}, narrow_y{0.0, 0.5 * texel};
  EXPECT_NEAR(maps.value(on_stripe, {.across = narrow_x, .along = {0.0, 12 * texel}})[0], 1.0,
              0.01);
  EXPECT_NEAR(maps.value(on_stripe, {.across = {12 * texel, 0.0}, .along = narrow_y})[0], 0.5,
              0.06);
}

TEST(MipMaps, ChangeLittleFromFootprintToFootprint) {
  const MipMaps maps(noise(64, 64), Data);
  double last = -1.0;
  for (double size = 0.2 / 64; size < 2.0; size *= 1.02) {
    const double value = maps.value({0.31, 0.62}, {.across = {size, 0}, .along = {0, size}})[0];
    if (last >= 0.0) {
      EXPECT_NEAR(value, last, 0.05) << size;
    }
    last = value;
  }
}

/// Differing normals average to a shorter vector, which makes the surface rougher.
TEST(MipMaps, OfNormalsKnowHowMuchTheyDiffer) {
  const double tilt = 0.6;
  const auto texture = codes(32, 32, [&](int x, int) {
    const double side = x % 2 == 0 ? tilt : -tilt;
    return std::array{static_cast<int>(std::lround(127.5 + 127.5 * side)), 128,
                      static_cast<int>(std::lround(127.5 + 127.5 * std::sqrt(1 - tilt * tilt))),
                      255};
  });
  const MipMaps maps(texture, Normals);
  const auto length_at = [&](double size) {
    const MipMaps::Value v =
        maps.value({0.5 / 32, 0.5 / 32}, {.across = {size, 0}, .along = {0, size}});
    return length(Vec3{v[0], v[1], v[2]});
  };
  EXPECT_NEAR(length_at(0.0), 1.0, 1e-3);
  EXPECT_NEAR(length_at(0.5), std::sqrt(1 - tilt * tilt), 0.01);
}

TEST(MipMaps, TakeAnyNumbers) {
  const MipMaps maps(noise(5, 3), Colour);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const double odd : {kInfinity, -kInfinity, std::nan(""), 1e300, -1e18, 0.0})
    for (const double size : {kInfinity, std::nan(""), 1e300, 0.0})
      for (const double v : maps.value({odd, odd}, {.across = {size, 0}, .along = {size, size}})) {
        EXPECT_GE(v, 0.0);
        EXPECT_LE(v, 1.0);
      }
}

}  // namespace
}  // namespace lenticule::render
