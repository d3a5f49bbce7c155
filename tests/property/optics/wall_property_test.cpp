// SPDX-License-Identifier: Apache-2.0
// A panel that is cut in two is a wall of two panels: their rays are those of the whole.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "optics/row_rays.h"
#include "optics/wall/wall.h"
#include "tests/support/random_rigs.h"

namespace lenticule::optics {
namespace {

/// Returns the left or right half of a rig, with the viewer at the same place.
Rig half_of(const Rig& whole, double side) {
  Rig half = whole;
  half.panel.width_px = whole.panel.width_px / 2;
  const double moved_px = side * whole.panel.width_px / 4.0;
  half.sheet.offset = whole.sheet.offset + Lenses(3.0 * moved_px / whole.sheet.pitch.value);
  half.viewing.centre = whole.viewing.centre - whole.panel.pixel_width * moved_px;
  return half;
}

TEST(WallOfTwoHalves, HasTheRaysOfTheWholePanel) {
  std::mt19937_64 random(11);
  double worst_mm = 0.0, worst_tan = 0.0;
  for (int n = 0; n < 20; ++n) {
    Rig whole = test::kiosk_rig();
    whole.viewing.height = Millimetres(std::uniform_real_distribution(-200.0, 200.0)(random));
    whole.viewing.centre = Millimetres(std::uniform_real_distribution(-200.0, 200.0)(random));
    const RowRayEvaluator of_whole{OpticalModel(whole)};
    RowRays expected, rays;
    const int row = static_cast<int>(random() % 2160);
    of_whole.evaluate(row, 0, whole.panel.width_px, expected);
    for (const double side : {-1.0, 1.0}) {
      const Rig half = half_of(whole, side);
      RowRayEvaluator{OpticalModel(half)}.evaluate(row, 0, half.panel.width_px, rays);
      const size_t first = side < 0.0 ? 0 : rays.lens_x_mm.size();
      const double moved_mm = side * whole.panel.pixel_width.value * half.panel.width_px / 2.0;
      for (size_t s = 0; s < rays.lens_x_mm.size(); ++s) {
        worst_mm = std::max({worst_mm,
                             std::abs(rays.lens_x_mm[s] + moved_mm - expected.lens_x_mm[first + s]),
                             std::abs(rays.lens_y_mm[s] - expected.lens_y_mm[first + s])});
        worst_tan = std::max({worst_tan, std::abs(rays.tan_x[s] - expected.tan_x[first + s]),
                              std::abs(rays.tan_y[s] - expected.tan_y[first + s])});
      }
    }
  }
  EXPECT_LT(worst_mm, 1e-10);
  EXPECT_LT(worst_tan, 1e-12);
}

}  // namespace
}  // namespace lenticule::optics
