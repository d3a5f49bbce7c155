// SPDX-License-Identifier: Apache-2.0
// Tests the sample positions in a beam, their rays, and their number.
#include <gtest/gtest.h>

#include <limits>

#include "base/error.h"
#include "render/depth_budget/prefilter.h"
#include "tests/support/oracles/beam_oracle.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;

TEST(PrefilterName, AcceptsFourNames) {
  EXPECT_EQ(prefilter_named("off"), Prefilter::Off);
  EXPECT_EQ(prefilter_named("depth"), Prefilter::Depth);
  EXPECT_EQ(prefilter_named("beam"), Prefilter::Beam);
  EXPECT_EQ(prefilter_named("exhaustive"), Prefilter::Exhaustive);
  try {
    (void)prefilter_named("blur");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Usage);
    EXPECT_STREQ(error.what(), "prefilter 'blur': unknown");
    EXPECT_EQ(error.hint(), "use off, depth, beam or exhaustive");
  }
}

/// The footprint agrees with the searched eye to a hundredth of a subpixel.
TEST(BeamRay, GoesToTheEyeThatSeesThePlace) {
  for (const double distance : {700.0, std::numeric_limits<double>::infinity()})
    for (const double slant : {0.0, 1.0 / 3.0}) {
      const optics::OpticalModel model(
          make_rig({.width = 40, .height = 12, .slant = slant, .distance_mm = distance}));
      for (const SubpixelPlace place : beam_samples(9)) {
        const Footprint footprint(model, place);
        for (int i = 0; i < 40; i += 3)
          for (int c = 0; c < 3; ++c) {
            const optics::SubpixelRay middle = model.ray(i, 5, c);
            const PanelRay ray = footprint.displaced(
                {middle.lens_x_mm, middle.lens_y_mm, middle.tan_x, middle.tan_y});
            const test::ReferenceLine line = test::beam_line(model, i, 5, c, place);
            EXPECT_NEAR(ray.x_mm, line.x_mm, 1e-2 * 5.0 / 3.0);
            EXPECT_NEAR(ray.y_mm, line.y_mm, 1e-9);
            EXPECT_NEAR(ray.tan_x, line.tan_x, 1e-2 * 0.55 / 7.7);
            EXPECT_NEAR(ray.tan_y, line.tan_y, 1e-9);
          }
      }
    }
}

}  // namespace
}  // namespace lenticule::render
