// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/depth_budget/prefilter.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;

TEST(DepthOfField, StraightAheadIsGapTimesPitch) {
  const optics::OpticalModel model(make_rig({}));
  const DepthOfField field(model);
  EXPECT_DOUBLE_EQ(field.along_mm(0.0, 0.0), model.depth_of_field_mm());
}

/// A point at the depth of field moves by a lens pitch from one subpixel to the next: by
/// definition, for rays as oblique as a rig has them. Lenses as wide as these are not a fine
/// grating: the distance of two subpixels under one lens is accurate to a percent.
TEST(DepthOfField, IsTheDepthAtWhichASubpixelIsAsWideAsALens) {
  double most_oblique = 0.0;
  for (const double distance : {400.0, std::numeric_limits<double>::infinity()})
    for (const double height : {0.0, 200.0}) {
      const bool parallel = std::isinf(distance);
      const optics::OpticalModel model(make_rig({.width = 90,
                                                 .height = 40,
                                                 .pitch_subpx = 31.0,
                                                 .slant = 0.0,
                                                 .distance_mm = distance,
                                                 .eye_height_mm = parallel ? 0.4 : height}));
      const DepthOfField field(model);
      int compared = 0;
      for (int j = 0; j < 40; j += 13)
        for (int i = 0; i < 90; ++i) {
          const optics::SubpixelRay left = model.ray(i, j, 0), middle = model.ray(i, j, 1),
                                    right = model.ray(i, j, 2);
          if (left.lens != right.lens) continue;
          ++compared;
          most_oblique = std::max(most_oblique, std::abs(middle.tan_x));
          const double step = std::abs(right.tan_x - left.tan_x) / 2.0;
          const double expected = model.pitch_mm() / step;
          EXPECT_NEAR(field.along_mm(middle.tan_x, middle.tan_y), expected, 1e-2 * expected);
          EXPECT_GE(expected, field.least_mm() * 0.99);
        }
      EXPECT_GT(compared, 150);
    }
  EXPECT_GT(most_oblique, 0.5);
}

TEST(DepthOfField, LeastIsALowerBoundForAnyRay) {
  const DepthOfField field{optics::OpticalModel(make_rig({}))};
  for (double x = -3.0; x <= 3.0; x += 0.1)
    for (double y = -3.0; y <= 3.0; y += 0.1)
      EXPECT_GE(field.along_mm(x, y), field.least_mm() * (1.0 - 1e-12)) << x << " " << y;
}

}  // namespace
}  // namespace lenticule::render
