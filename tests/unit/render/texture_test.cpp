// SPDX-License-Identifier: Apache-2.0
#include "render/texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace lenticule::render {
namespace {

/// 2 x 2: red counts columns, green counts rows, blue is 1 in the bottom right only.
Texture four_texels() {
  Texture texture;
  texture.width = 2;
  texture.height = 2;
  texture.rgba = {0, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, 1, 1, 1, 1, 1};
  return texture;
}

TEST(TextureValue, IsTheTexelAtItsCentre) {
  const Texture texture = four_texels();
  EXPECT_DOUBLE_EQ(texture_value(texture, 0.25, 0.25, 0), 0.0);
  EXPECT_DOUBLE_EQ(texture_value(texture, 0.75, 0.25, 0), 1.0);
  EXPECT_DOUBLE_EQ(texture_value(texture, 0.25, 0.75, 1), 1.0);
  EXPECT_DOUBLE_EQ(texture_value(texture, 0.75, 0.75, 2), 1.0);
}

TEST(TextureValue, IsBilinearBetweenCentres) {
  const Texture texture = four_texels();
  EXPECT_DOUBLE_EQ(texture_value(texture, 0.375, 0.25, 0), 0.25);
  EXPECT_DOUBLE_EQ(texture_value(texture, 0.5, 0.5, 2), 0.25);
}

TEST(TextureValue, VZeroIsTheTop) {
  EXPECT_LT(texture_value(four_texels(), 0.5, 0.3, 1), texture_value(four_texels(), 0.5, 0.7, 1));
}

TEST(TextureValue, RepeatsOrContinuesItsBorder) {
  Texture texture = four_texels();
  for (const double whole : {-1e6, -3.0, 1.0, 1e9})
    EXPECT_NEAR(texture_value(texture, whole + 0.25, 0.25, 0), 0.0, 1e-6);
  EXPECT_DOUBLE_EQ(texture_value(texture, 1.0, 0.25, 0), 0.5);
  texture.repeat_u = false;
  EXPECT_DOUBLE_EQ(texture_value(texture, 1.0, 0.25, 0), 1.0);
  EXPECT_DOUBLE_EQ(texture_value(texture, 1e300, 0.25, 0), 1.0);
  EXPECT_DOUBLE_EQ(texture_value(texture, -1e300, 0.25, 0), 0.0);
}

TEST(TextureValue, SurvivesCoordinatesThatAreNotNumbers) {
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_TRUE(std::isfinite(texture_value(four_texels(), bad, bad, 0)));
}

}  // namespace
}  // namespace lenticule::render
