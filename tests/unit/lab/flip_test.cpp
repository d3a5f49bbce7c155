// SPDX-License-Identifier: Apache-2.0
// Tests FLIP against its definition in long double, and its basic properties.
#include "lab/flip.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/support/error_matchers.h"
#include "tests/support/oracles/picture_oracle.h"

namespace lenticule::lab {
namespace {

using test::error_of;

/// Returns soft coloured waves with an edge and noise of the given strength.
frames::WovenFrame scene(int width, int height, double noise, unsigned seed = 1) {
  std::mt19937 random(seed);
  frames::WovenFrame frame({.width = width, .height = height});
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i)
      for (int c = 0; c < 3; ++c) {
        const double wave = 110 + 80 * std::sin(0.5 * i + 2 * c) * std::cos(0.3 * j + c);
        const double edge = 3 * i > 2 * j + width / 2 ? 40 : 0;
        const double off = noise * (static_cast<double>(random() % 2001U) / 1000.0 - 1.0);
        frame.row(j)[3 * i + c] = static_cast<uint8_t>(std::clamp(wave + edge + off, 0.0, 255.0));
      }
  return frame;
}

std::vector<float> map_of(const frames::WovenFrame& a, const frames::WovenFrame& b, double ppd) {
  return flip_map(FlipPicture(a.view(), ppd), FlipPicture(b.view(), ppd));
}

frames::WovenFrame flat(uint8_t r, uint8_t g, uint8_t b) {
  frames::WovenFrame frame({.width = 20, .height = 12});
  for (size_t i = 0; i < frame.bytes().size(); i += 3) {
    frame.bytes()[i] = r;
    frame.bytes()[i + 1] = g;
    frame.bytes()[i + 2] = b;
  }
  return frame;
}

TEST(Flip, AgreesWithItsDefinition) {
  for (const double ppd : {7.0, 30.6, kFlipPixelsPerDegree}) {
    for (const double noise : {2.0, 20.0, 255.0}) {
      const frames::WovenFrame a = scene(19, 14, 0);
      const frames::WovenFrame b = scene(19, 14, noise, 7);
      const std::vector<float> map = map_of(a, b, ppd);
      for (int j = 0; j < 14; j += 3)
        for (int i = 0; i < 19; i += 3)
          EXPECT_NEAR(map[static_cast<size_t>(19 * j + i)],
                      static_cast<double>(test::flip_by_definition(a.view(), b.view(), i, j, ppd)),
                      2e-4)
              << i << ", " << j << " at " << ppd << ", noise " << noise;
    }
  }
}

TEST(Flip, IsScaledAsPublishedForTheFurthestColours) {
  const auto everywhere = [](const frames::WovenFrame& a, const frames::WovenFrame& b,
                             double expected) {
    for (const float value : map_of(a, b, 30.0)) ASSERT_NEAR(value, expected, 1e-4);
  };
  everywhere(flat(0, 255, 0), flat(0, 0, 255), 1.0);
  // Flat greys differ in lightness alone: L* of white is 100, of black 0.
  const double largest = static_cast<double>(
      test::flip_by_definition(flat(0, 0, 0).view(), flat(255, 255, 255).view(), 5, 5, 30.0));
  everywhere(flat(0, 0, 0), flat(255, 255, 255), largest);
  EXPECT_GT(largest, 0.95);
}

TEST(Flip, IsZeroForEqualPicturesOnly) {
  const frames::WovenFrame a = scene(40, 30, 0);
  for (const float value : map_of(a, a, 30.0)) ASSERT_EQ(value, 0.0F);
  frames::WovenFrame b = a;
  b.row(15)[3 * 20 + 1] ^= 8U;
  const std::vector<float> map = map_of(a, b, 30.0);
  EXPECT_GT(map[15 * 40 + 20], 0.0F);
  EXPECT_EQ(map[0], 0.0F) << "what is far away is not touched";
}

TEST(Flip, FiguresAreMeanAndPercentile) {
  std::vector<float> map(200);
  for (size_t i = 0; i < map.size(); ++i) map[i] = static_cast<float>((i * 77) % 200);
  const FlipFigures figures = flip_figures(map);
  EXPECT_DOUBLE_EQ(figures.mean, 99.5);
  EXPECT_DOUBLE_EQ(figures.percentile_99, 197.0) << "198 of the 200 are not above it";
  EXPECT_DOUBLE_EQ(flip_figures({0.25F}).percentile_99, 0.25);
  EXPECT_DOUBLE_EQ(flip_figures({}).mean, 0.0);
}

TEST(Flip, RefusesIncomparablePictures) {
  const frames::WovenFrame a = scene(20, 10, 0);
  EXPECT_EQ(error_of([&] { (void)FlipPicture(a.view(), 0.0); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([&] { (void)FlipPicture(a.view(), std::nan("")); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([&] { (void)map_of(a, scene(10, 20, 0), 30.0); }).kind(), ErrorKind::Input);
  EXPECT_EQ(error_of([&] {
              (void)flip_map(FlipPicture(a.view(), 30.0), FlipPicture(a.view(), 31.0));
            }).kind(),
            ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::lab
