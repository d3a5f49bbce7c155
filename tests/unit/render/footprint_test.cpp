// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "render/rays/primary_rays.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;

// The model uses the exact vertical shift where a slanted lens turns it into a horizontal one; the
// footprint treats it as constant across the subpixel. The error may be a hundredth of a subpixel:
// of its width on the panel, and of its step in the tangent.
constexpr double kWidthShare = 1e-2 * 5.0 / 3.0;
constexpr double kTangentShare = 1e-2 * 0.55 / 7.7;

PanelRay centre_ray(const optics::OpticalModel& model, int i, int j, int channel) {
  const optics::SubpixelRay ray = model.ray(i, j, channel);
  return {ray.lens_x_mm, ray.lens_y_mm, ray.tan_x, ray.tan_y};
}

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

TEST(Footprint, CentreIsTheRayItself) {
  const optics::OpticalModel model(make_rig({}));
  const PanelRay ray = centre_ray(model, 5, 3, 1);
  const PanelRay same = Footprint(model, {}).displaced(ray);
  EXPECT_EQ(ray.x_mm, same.x_mm);
  EXPECT_EQ(ray.tan_x, same.tan_x);
  EXPECT_EQ(ray.tan_y, same.tan_y);
}

/// One subpixel to the right by the footprint is the next subpixel by the model, if both are under
/// one lens.
TEST(Footprint, AgreesWithTheModelOneSubpixelFurther) {
  for (const double distance : {700.0, std::numeric_limits<double>::infinity()}) {
    const optics::OpticalModel model(make_rig({.width = 60, .distance_mm = distance}));
    const Footprint right(model, {1.0, 0.0});
    int compared = 0;
    for (int i = 0; i < 60; ++i) {
      if (model.ray(i, 3, 0).lens != model.ray(i, 3, 1).lens) continue;
      ++compared;
      const PanelRay expected = centre_ray(model, i, 3, 1);
      const PanelRay moved = right.displaced(centre_ray(model, i, 3, 0));
      EXPECT_NEAR(moved.x_mm, expected.x_mm, kWidthShare);
      EXPECT_NEAR(moved.tan_x, expected.tan_x, kTangentShare);
      EXPECT_NEAR(moved.tan_y, expected.tan_y, 1e-9);
    }
    EXPECT_GT(compared, 30);
  }
}

/// The same holds along the lens: one pixel row further is the model's next row.
TEST(Footprint, AgreesWithTheModelOneRowFurther) {
  for (const double slant : {0.0, 0.2, -0.3}) {
    const optics::OpticalModel model(
        make_rig({.width = 60, .height = 40, .slant = slant, .eye_height_mm = 31.0}));
    const Footprint down(model, {0.0, 1.0});
    int compared = 0;
    for (int i = 0; i < 60; ++i) {
      if (model.ray(i, 20, 1).lens != model.ray(i, 21, 1).lens) continue;
      ++compared;
      const PanelRay expected = centre_ray(model, i, 21, 1);
      const PanelRay moved = down.displaced(centre_ray(model, i, 20, 1));
      EXPECT_NEAR(moved.x_mm, expected.x_mm, kWidthShare) << slant;
      EXPECT_NEAR(moved.y_mm, expected.y_mm, 1e-9);
      EXPECT_NEAR(moved.tan_x, expected.tan_x, kTangentShare);
      EXPECT_NEAR(moved.tan_y, expected.tan_y, 1e-9);
    }
    EXPECT_GT(compared, 20);
  }
}

}  // namespace
}  // namespace lenticule::render
