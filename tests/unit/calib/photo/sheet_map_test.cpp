// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "calib/photo/single_photo.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

double bow(double x, double y) {
  return 0.1 * std::cos(3.0 * x) * std::sin(2.5 * y) + 0.02 * x;
}

struct Measured {
  std::vector<FringeBlock> blocks;
  std::vector<double> residuals;
};
Measured measured() {
  Measured out;
  for (int r = 0; r < 16; ++r) {
    for (int c = 0; c < 24; ++c) {
      FringeBlock b;
      b.x = (c + 0.5) / 24.0 - 0.5;
      b.y = (r + 0.5) / 16.0 - 0.5;
      out.blocks.push_back(b);
      out.residuals.push_back(-bow(b.x, b.y));
    }
  }
  return out;
}

double worst(const optics::ResidualMap& map) {
  double off = 0.0;
  for (int r = 0; r < map.rows; ++r)
    for (int c = 0; c < map.columns; ++c)
      off = std::max(off, std::abs(map.lenses[static_cast<size_t>(r * map.columns + c)] -
                                   bow(c / (map.columns - 1.0) - 0.5, r / (map.rows - 1.0) - 0.5)));
  return off;
}

TEST(SheetMap, FollowsASmoothShapeUpToTheBorder) {
  const Measured m = measured();
  const optics::ResidualMap map = smooth_map(m.blocks, m.residuals);
  ASSERT_EQ(map.lenses.size(), static_cast<size_t>(map.columns * map.rows));
  EXPECT_LT(worst(map), 0.006);
}

TEST(SheetMap, ToleratesABubble) {
  Measured m = measured();
  for (const size_t i : {100U, 101U, 200U, 300U}) m.residuals[i] = 0.45;
  EXPECT_LT(worst(smooth_map(m.blocks, m.residuals)), 0.02);
}

TEST(SheetMap, RefusesTooFewBlocks) {
  Measured m = measured();
  m.blocks.resize(99);
  m.residuals.resize(99);
  EXPECT_TRUE(smooth_map(m.blocks, m.residuals).empty());
}

TEST(SheetMap, EqualsTheSumOfItsPartsEverywhere) {
  optics::ResidualMap coarse{3, 2, {0.0, 0.1, 0.05, -0.1, 0.0, 0.2}};
  optics::ResidualMap fine{5, 4, {}};
  for (int i = 0; i < 20; ++i) fine.lenses.push_back(0.01 * std::sin(i));
  const optics::ResidualMap sum = sum_of_maps(coarse, fine);
  ASSERT_EQ(sum.columns, 5);
  ASSERT_EQ(sum.rows, 4);
  const optics::ResidualSpline a(coarse, 400, 300), b(fine, 400, 300), both(sum, 400, 300);
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 5; ++c)
      EXPECT_NEAR(both.at(100 * c, 100 * r).lenses,
                  a.at(100 * c, 100 * r).lenses + b.at(100 * c, 100 * r).lenses, 1e-12);
  EXPECT_EQ(sum_of_maps({}, fine), fine);
  EXPECT_EQ(sum_of_maps(fine, {}), fine);
}

}  // namespace
}  // namespace lenticule::calib
