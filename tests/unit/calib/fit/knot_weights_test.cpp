// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <random>

#include "calib/fit/observations.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

TEST(KnotWeights, AgreeWithTheSpline) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> lenses(-0.2, 0.2), place(-0.1, 1.1);
  for (const KnotGrid grid : {KnotGrid{2, 2}, KnotGrid{5, 3}, KnotGrid{24, 14}, KnotGrid{1, 1}}) {
    optics::ResidualMap map{.columns = grid.columns, .rows = grid.rows, .lenses = {}};
    for (int k = 0; k < grid.count(); ++k) map.lenses.push_back(lenses(random));
    const optics::ResidualSpline spline(map, 1920, 1080);
    for (int n = 0; n < 500; ++n) {
      const Vec2 p{1920.0 * place(random), 1080.0 * place(random)};
      double sum = 0.0;
      for (const KnotWeight& k : knot_weights(grid, p, 1920, 1080))
        sum += k.weight * map.lenses[static_cast<size_t>(k.knot)];
      ASSERT_NEAR(sum, spline.at(p.x, p.y).lenses, 1e-12) << p.x << ' ' << p.y;
    }
  }
}

}  // namespace
}  // namespace lenticule::calib
