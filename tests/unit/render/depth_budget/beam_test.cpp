// SPDX-License-Identifier: Apache-2.0
// Tests the sample positions in a beam, their rays, and their number.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "render/depth_budget/prefilter.h"
#include "tests/support/oracles/beam_oracle.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;

TEST(BeamSamples, StartInTheMiddleAndAreSymmetric) {
  for (const int count : {1, 3, 4, 5, 9, 17, 64, 257}) {
    const auto places = beam_samples(count);
    ASSERT_EQ(places.size(), static_cast<size_t>(count % 2 == 0 ? count - 1 : count));
    EXPECT_EQ(places[0].x, 0.0);
    EXPECT_EQ(places[0].y, 0.0);
    EXPECT_EQ(places[0].lens, 0.0);
    for (size_t k = 1; k < places.size(); k += 2) {
      EXPECT_EQ(places[k].x, -places[k + 1].x);
      EXPECT_EQ(places[k].y, -places[k + 1].y);
      EXPECT_EQ(places[k].lens, -places[k + 1].lens);
    }
  }
}

TEST(BeamSamples, FillTheBeamEvenly) {
  for (const int count : {17, 257}) {
    std::set<int> strata;
    // Star discrepancy in the plane of height and lens: the share of samples in boxes that begin in
    // a corner.
    const auto places = beam_samples(count);
    for (const SubpixelPlace& place : places) {
      EXPECT_LE(std::abs(place.x), 0.5);
      EXPECT_LE(std::abs(place.y), 0.5);
      EXPECT_LE(std::abs(place.lens), 0.5);
      strata.insert(static_cast<int>(std::floor((place.x + 0.5) * count)));
    }
    EXPECT_EQ(strata.size(), static_cast<size_t>(count));
    double worst = 0.0;
    for (double y = 0.05; y <= 1.0; y += 0.05)
      for (double lens = 0.05; lens <= 1.0; lens += 0.05) {
        const auto inside = std::ranges::count_if(
            places, [&](const SubpixelPlace& p) { return p.y + 0.5 < y && p.lens + 0.5 < lens; });
        worst = std::max(worst, std::abs(static_cast<double>(inside) / count - y * lens));
      }
    EXPECT_LT(worst, count == 17 ? 0.15 : 0.02) << count;
  }
}

TEST(BeamRays, GrowWithTheDepth) {
  EXPECT_EQ(beam_rays(0.0, 17), 5);
  EXPECT_EQ(beam_rays(1.0, 17), 5);
  EXPECT_EQ(beam_rays(1.01, 17), 5);
  EXPECT_EQ(beam_rays(1.5, 17), 5);
  EXPECT_EQ(beam_rays(3.5, 17), 9);
  EXPECT_EQ(beam_rays(7.5, 65), 17);
  EXPECT_EQ(beam_rays(7.6, 65), 33);
  EXPECT_EQ(beam_rays(std::numeric_limits<double>::infinity(), 65), 65);
}

TEST(BeamRays, AreOddAndWithinTheLimit) {
  for (const int most : {3, 4, 8, 16, 17, 100, 1024})
    for (double depth = 0.01; depth < 1000.0; depth *= 1.3) {
      EXPECT_LE(beam_rays(depth, most), most);
      EXPECT_EQ(beam_rays(depth, most) % 2, 1);
      EXPECT_GE(beam_rays(depth, most), 3);
    }
}

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
