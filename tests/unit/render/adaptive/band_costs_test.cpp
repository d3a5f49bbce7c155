// SPDX-License-Identifier: Apache-2.0
// Tests the estimated costs of bands.
#include <gtest/gtest.h>

#include "render/methods/adaptive/audit.h"

namespace lenticule::render {
namespace {

constexpr size_t kSubpixels = 16 * 5760;
constexpr BandCounts kFloor{.seen = kSubpixels, .cuts = 32, .audited = 360, .rays = 360};

TEST(BandCosts, ABandThatIsLookedUpGains) {
  for (const bool has_pbr : {false, true}) {
    const BandCosts costs =
        BandCostModel{.subpixels = kSubpixels, .has_pbr = has_pbr}.costs(kFloor);
    EXPECT_EQ(costs.shading, 0);
    EXPECT_LT(2 * costs.spent(), costs.full);
  }
}

TEST(BandCosts, ShadingEverySubpixelCostsMoreThanFullUnlessRaysAreExpensive) {
  BandCounts shaded = kFloor;
  shaded.shaded = shaded.seen;
  for (const bool has_pbr : {false, true}) {
    const BandCostModel model{.subpixels = kSubpixels, .has_pbr = has_pbr};
    const BandCosts few_rays = model.costs(shaded);
    EXPECT_GT(few_rays.shading, few_rays.full);
    shaded.rays = 50 * kFloor.rays;
    const BandCosts many_rays = model.costs(shaded);
    EXPECT_LT(many_rays.shading, many_rays.full);
    shaded.rays = kFloor.rays;
  }
  const BandCosts soft = BandCostModel{.subpixels = kSubpixels, .is_soft = true}.costs(shaded);
  EXPECT_LT(soft.shading, soft.full);
}

TEST(BandCosts, RaysCountForSubpixelsThatSeeASurface) {
  // The same rays of the audit come from a tenth of the subpixels: each has ten times as many.
  BandCounts tenth = kFloor;
  tenth.seen /= 10;
  const BandCostModel model{.subpixels = kSubpixels};
  const int64_t of_one = model.costs(tenth).full / tenth.seen;
  EXPECT_GT(of_one, model.costs(kFloor).full / kFloor.seen * 2);
}

TEST(BandCosts, OfAnEmptyBandAreZero) {
  EXPECT_EQ(BandCostModel{.subpixels = kSubpixels}.costs({}).full, 0);
  EXPECT_EQ(BandCostModel{}.costs({}).spent(), 0);
}

}  // namespace
}  // namespace lenticule::render
