// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>

#include "render/rays/primary_rays.h"
#include "tests/support/tiny_scenes.h"

namespace lenticule::render {
namespace {

using test::make_rig;

TEST(TilePlan, CoversEverySubpixelExactlyOnce) {
  for (const int width : {1, 31, 33, 100})
    for (const int height : {1, 15, 17, 40})
      for (const double slant : {0.0, 1.0 / 3.0, -0.2521, 4.0, -4.0})
        for (const char* layout : {"rgb", "vbgr", "cells"}) {
          const TilePlan plan(
              make_rig({.width = width, .height = height, .slant = slant, .layout = layout}));
          std::vector<int> visits(static_cast<size_t>(3 * width * height), 0);
          for (int index = 0; index < plan.count(); ++index) {
            const Tile tile = plan.tile(index);
            for (int row = 0; row < tile.rows; ++row)
              for (int column = 0; column < tile.columns; ++column) {
                const int s = plan.subpixel(tile, column, row);
                if (s < 0 || s >= 3 * width) continue;
                ++visits[static_cast<size_t>((tile.row_begin + row) * 3 * width + s)];
              }
          }
          for (const int count : visits) ASSERT_EQ(count, 1) << width << "x" << height;
        }
}

TEST(TilePlan, ColumnsStayUnderTheirLens) {
  for (const double slant : {0.2521, -0.4, 1.0}) {
    const optics::Rig rig = make_rig({.width = 800, .height = 64, .slant = slant, .pixel_mm = 0.5});
    const optics::OpticalModel model(rig);
    const TilePlan plan(rig);
    const Tile tile = plan.tile(2);
    const auto phase = [&](int row) {
      const int s = plan.subpixel(tile, 40, row);
      const Vec2 centre = rig.panel.subpixel_centre_px(s / 3, tile.row_begin + row, s % 3);
      return model.lens_coordinate(centre.x, centre.y, s % 3);
    };
    // A column stays within half a subpixel of the phase of its first row.
    for (int row = 1; row < tile.rows; ++row)
      EXPECT_NEAR(phase(row), phase(0), 0.5 / rig.sheet.pitch.value + 1e-9) << slant;
  }
}

TEST(BeamSize, GrowsWithTheDistanceBetweenViewsWhereALensHasMoreThanOne) {
  optics::Rig rig = make_rig({.width = 40, .height = 30, .slant = 0.0});
  rig.sheet.pitch = Subpixels(12.0);
  const double subpixel_mm = rig.panel.pixel_width.value / 3.0;
  const double far = 1e4 * rig.sheet.gap.value;
  EXPECT_NEAR(TilePlan(rig).beam().across_mm(-far), subpixel_mm * 1e4, 1e-6 * far);
  // A lens over one pixel has a single view: textures are as fine as the pixels.
  rig.sheet.pitch = Subpixels(2.9);
  rig.viewing.distance = Millimetres(std::numeric_limits<double>::infinity());
  EXPECT_NEAR(TilePlan(rig).beam().across_mm(-far), 2.9 * subpixel_mm, 1e-9);
}

}  // namespace
}  // namespace lenticule::render
