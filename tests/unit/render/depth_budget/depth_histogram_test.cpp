// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "render/depth_budget/prefilter.h"
#include "render/row_sweep/row_sweep.h"
#include "tests/support/oracles/visibility_oracle.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;
using test::make_tiny_stage;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(DepthHistogram, CountsEachSubpixelOnce) {
  DepthHistogram h{.views = 8.0};
  h.add(0.0, 0.0);
  h.add(0.125, 1.0);  // still in the panel's plane: an eighth
  h.add(-0.126, -1.0);
  h.add(1.0, 8.0);  // still within the depth of field
  h.add(1.01, 8.1);
  h.add(-2.0, -16.0);
  h.add(-50.0, -400.0);
  h.add(-kInfinity, -kInfinity);
  EXPECT_EQ(h.subpixels(), 8U);
  EXPECT_EQ(h.at_panel, 2U);
  EXPECT_EQ(h.within, 4U);
  EXPECT_EQ(h.in_front, 1U);
  EXPECT_EQ(h.behind, 2U);
  EXPECT_EQ(h.nothing, 1U);
  EXPECT_EQ(h.nearest_mm, 8.1);
  EXPECT_EQ(h.farthest_mm, -400.0);
}

TEST(DepthHistogram, BinsIncludeTheirLowerEdge) {
  DepthHistogram h;
  for (const double depth : {-0.125, -0.001, 0.0, 0.124, 16.0, 99.0, -16.0, -99.0}) h.add(depth, 0);
  const auto& bins = h.bins;
  const size_t zero = bins.size() / 2;
  EXPECT_EQ(DepthHistogram::bin_begin(zero), 0.0);
  EXPECT_EQ(bins[zero], 2U);
  EXPECT_EQ(bins[zero - 1], 2U);
  EXPECT_EQ(bins.front(), 2U);
  EXPECT_EQ(bins.back(), 2U);
  EXPECT_EQ(std::accumulate(bins.begin(), bins.end(), uint64_t{0}), 8U);
}

/// Compares every subpixel with the reference visibility and the definition.
TEST(MeasureDepth, AgreesWithTheReference) {
  for (const char* layout : {"rgb", "cells"}) {
    const optics::OpticalModel model(
        make_rig({.width = 24, .height = 12, .layout = layout, .pixel_mm = 2.5}));
    const Stage stage = make_tiny_stage({.depth_scale = 6.0, .turn_degrees = 20.0});
    for (const test::NamedScene& named : test::tiny_scenes()) {
      const Scene scene(named.scene, stage, {}, 1);
      const DepthOfField field(model);
      DepthHistogram expected{.views = model.rig().sheet.pitch.value};
      for (int j = 0; j < 12; ++j)
        for (int s = 0; s < 72; ++s) {
          const test::OracleRay ray = test::oracle_ray(model, s / 3, j, s % 3);
          double z_mm = -kInfinity;
          for (const test::OracleHit& hit : test::oracle_hits(scene, ray, 0.99 * 700.0))
            if (hit.met) z_mm = std::max(z_mm, hit.z_mm);
          expected.add(z_mm / field.along_mm(ray.tan_x, ray.tan_y), z_mm);
        }
      const DepthHistogram h = measure_depth(model, scene, 2);
      EXPECT_EQ(h.subpixels(), 24U * 12U * 3U);
      // A subpixel on an edge may see the other side.
      const auto close = [&](uint64_t a, uint64_t b) {
        return std::abs(static_cast<double>(a) - static_cast<double>(b)) <= 1.0;
      };
      EXPECT_TRUE(close(h.within, expected.within)) << named.name;
      EXPECT_TRUE(close(h.at_panel, expected.at_panel)) << named.name;
      EXPECT_TRUE(close(h.in_front, expected.in_front)) << named.name;
      EXPECT_TRUE(close(h.behind, expected.behind)) << named.name;
      EXPECT_TRUE(close(h.nothing, expected.nothing)) << named.name;
      EXPECT_NEAR(h.nearest_mm, expected.nearest_mm, 2.0);
    }
  }
}

TEST(MeasureDepth, PicturesAgreeWithTheCounts) {
  const optics::OpticalModel model(make_rig({.width = 24, .height = 12, .pixel_mm = 2.5}));
  SceneDescription pane;
  pane.materials = {Material{}};
  pane.meshes = {test::rectangle_mesh({-500, -500, 0}, {500, 0, 0}, {0, 1000, 0}, 0),
                 test::rectangle_mesh({0, -500, -400}, {500, 0, 0}, {0, 1000, 0}, 0)};
  pane.lights = {};
  const Scene scene(pane, make_tiny_stage({.mm_per_unit = 1.0}), {}, 1);
  frames::WovenFrame picture({24, 12, frames::PixelFormat::Rgb8});
  frames::WovenFrame beyond({24, 12, frames::PixelFormat::Rgb8});
  const DepthHistogram h = measure_depth(model, scene, 1, {.map = &picture, .beyond = &beyond});
  EXPECT_GT(h.at_panel, 0U);
  EXPECT_GT(h.behind, 0U);
  EXPECT_EQ(static_cast<uint64_t>(std::ranges::count(beyond.bytes(), 255)), h.behind + h.nothing);
  uint64_t white = 0, blue = 0;
  for (size_t n = 0; n < picture.bytes().size(); n += 3) {
    const uint8_t* p = picture.bytes().data() + n;
    white += p[0] == 255 && p[1] == 255 && p[2] == 255 ? 1 : 0;
    blue += p[0] == 0 && p[2] > 150 ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(3 * white), static_cast<double>(h.at_panel), 40.0);
  EXPECT_NEAR(static_cast<double>(3 * blue), static_cast<double>(h.behind), 40.0);
}

TEST(MeasureDepth, DoesNotDependOnThreads) {
  const optics::OpticalModel model(make_rig({.width = 60, .height = 70, .pixel_mm = 1.0}));
  const Scene scene(test::tiny_scenes()[0].scene, make_tiny_stage({.depth_scale = 3.0}), {}, 5);
  const DepthHistogram one = measure_depth(model, scene, 1);
  const DepthHistogram many = measure_depth(model, scene, 5);
  EXPECT_EQ(one.bins, many.bins);
  EXPECT_EQ(one.nothing, many.nothing);
}

}  // namespace
}  // namespace lenticule::render
