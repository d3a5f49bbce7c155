// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "render/rays/primary_rays.h"

namespace lenticule::render {
namespace {

TEST(FootprintSamples, OneIsTheCentre) {
  const auto samples = footprint_samples(1);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].x, 0.0);
  EXPECT_EQ(samples[0].y, 0.0);
}

TEST(FootprintSamples, AreCentredAndStayInsideTheSubpixel) {
  for (const int count : {2, 3, 4, 7, 16, 64}) {
    double x = 0.0;
    double y = 0.0;
    for (const SubpixelPlace place : footprint_samples(count)) {
      EXPECT_LE(std::abs(place.x), 0.5);
      EXPECT_LE(std::abs(place.y), 0.5);
      x += place.x;
      y += place.y;
    }
    EXPECT_NEAR(x, 0.0, 1e-12) << count;
    EXPECT_NEAR(y, 0.0, 1e-12) << count;
  }
}

TEST(FootprintSamples, HitEveryStratumInX) {
  const auto samples = footprint_samples(16);
  for (size_t i = 0; i < samples.size(); ++i)
    EXPECT_EQ(static_cast<size_t>((samples[i].x + 0.5) * 16.0), i);
}

}  // namespace
}  // namespace lenticule::render
