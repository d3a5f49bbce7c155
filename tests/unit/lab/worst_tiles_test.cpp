// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>

#include "lab/measures.h"
#include "tests/support/error_matchers.h"
#include "tests/support/oracles/picture_oracle.h"

namespace lenticule::lab {
namespace {

using frames::WovenFrame;
using test::error_of;

WovenFrame cut(const WovenFrame& picture, const Tile& tile) {
  WovenFrame part({.width = tile.width, .height = tile.height});
  for (int j = 0; j < tile.height; ++j)
    std::copy_n(picture.row(tile.y + j) + 3 * tile.x, 3 * tile.width, part.row(j));
  return part;
}

long double mse_in(const WovenFrame& a, const WovenFrame& b, const Tile& tile) {
  return test::mse_by_definition(cut(a, tile).view(), cut(b, tile).view(), -1);
}

/// Finds the worst tile by trying every position that the header allows.
std::optional<Tile> slowly_worst(const WovenFrame& a, const WovenFrame& b, int side,
                                 const std::vector<Tile>& taken) {
  std::optional<Tile> worst;
  for (int y = 0; y + side <= a.height(); ++y)
    for (int x = 0; x + side <= a.width(); ++x) {
      if ((x % 8 != 0 && x + side != a.width()) || (y % 8 != 0 && y + side != a.height())) continue;
      Tile tile{.x = x, .y = y, .width = side, .height = side, .mse = 0.0};
      if (std::ranges::any_of(taken, [&](const Tile& other) { return tile.overlaps(other); }))
        continue;
      tile.mse = static_cast<double>(mse_in(a, b, tile));
      if (tile.mse > (worst ? worst->mse : 0.0)) worst = tile;
    }
  return worst;
}

TEST(WorstTiles, AgreeWithASlowSearch) {
  std::mt19937 random(11);
  WovenFrame a({.width = 70, .height = 53});
  for (uint8_t& byte : a.bytes()) byte = static_cast<uint8_t>(random() & 255U);
  WovenFrame b = a;
  for (int n = 0; n < 40; ++n) b.bytes()[random() % b.bytes().size()] ^= 63U;
  const std::vector<Tile> found = worst_tiles(a.view(), b.view(), 17, 4);
  ASSERT_EQ(found.size(), 4U);
  std::vector<Tile> taken;
  for (const Tile& tile : found) {
    const auto expected = slowly_worst(a, b, 17, taken);
    ASSERT_TRUE(expected.has_value());
    EXPECT_EQ(tile.x, expected->x);
    EXPECT_EQ(tile.y, expected->y);
    EXPECT_NEAR(tile.mse, expected->mse, 1e-9);
    taken.push_back(tile);
  }
}

TEST(WorstTiles, FindTheCornerWithTheOnlyError) {
  const WovenFrame a({.width = 101, .height = 67});
  WovenFrame b = a;
  b.row(66)[3 * 100 + 2] = 255;
  const std::vector<Tile> found = worst_tiles(a.view(), b.view(), 32, 3);
  ASSERT_EQ(found.size(), 1U) << "nothing differs elsewhere";
  EXPECT_EQ(found[0].x, 101 - 32);
  EXPECT_EQ(found[0].y, 67 - 32);
  EXPECT_DOUBLE_EQ(found[0].mse, 255.0 * 255.0 / (3 * 32 * 32));
}

TEST(WorstTiles, AreNoLargerThanThePicture) {
  const WovenFrame a({.width = 12, .height = 200});
  WovenFrame b = a;
  b.row(150)[5] = 9;
  const std::vector<Tile> found = worst_tiles(a.view(), b.view(), 96, 2);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].width, 12);
  EXPECT_EQ(found[0].height, 96);
  EXPECT_TRUE(worst_tiles(a.view(), a.view(), 96, 2).empty());
}

TEST(WorstTiles, RefusesOtherSizes) {
  const WovenFrame a({.width = 12, .height = 20});
  const WovenFrame b({.width = 20, .height = 12});
  EXPECT_EQ(error_of([&] { (void)worst_tiles(a.view(), b.view(), 8, 1); }).kind(),
            ErrorKind::Input);
  EXPECT_EQ(error_of([&] { (void)worst_tiles(a.view(), a.view(), 0, 1); }).kind(),
            ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::lab
