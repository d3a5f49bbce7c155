// SPDX-License-Identifier: Apache-2.0
#include "optics/panel.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/error.h"

namespace lenticule::optics {
namespace {

TEST(SubpixelLayout, HasStripesFromLeftToRightByDefault) {
  const SubpixelLayout layout;
  EXPECT_EQ(layout.name(), "rgb");
  EXPECT_EQ(layout.offset(7, 9, 0), (SubpixelOffset{1.0 / 6.0, 0.5}));
  EXPECT_EQ(layout.offset(7, 9, 1), (SubpixelOffset{0.5, 0.5}));
  EXPECT_EQ(layout.offset(7, 9, 2), (SubpixelOffset{5.0 / 6.0, 0.5}));
}

TEST(SubpixelLayout, BgrIsRgbMirrored) {
  EXPECT_EQ(SubpixelLayout::bgr().offset(0, 0, 0), SubpixelLayout::rgb().offset(0, 0, 2));
}

TEST(SubpixelLayout, VerticalStripesDifferInY) {
  EXPECT_EQ(SubpixelLayout::vrgb().offset(3, 3, 0), (SubpixelOffset{0.5, 1.0 / 6.0}));
  EXPECT_EQ(SubpixelLayout::vbgr().offset(3, 3, 0), (SubpixelOffset{0.5, 5.0 / 6.0}));
}

TEST(SubpixelLayout, CellsRepeatOverThePanel) {
  std::vector<PixelCell> cells(6);
  for (size_t n = 0; n < cells.size(); ++n) cells[n][1].x_px = 0.1 * static_cast<double>(n);
  const SubpixelLayout layout = SubpixelLayout::cells(2, 3, cells);
  EXPECT_EQ(layout.offset(0, 0, 1).x_px, 0.0);
  EXPECT_EQ(layout.offset(1, 0, 1).x_px, 0.1);
  EXPECT_EQ(layout.offset(5, 4, 1).x_px, 0.1 * 3.0);
  EXPECT_EQ(layout.offset(4, 8, 1).x_px, 0.1 * 4.0);
}

TEST(SubpixelLayout, RefusesBadTables) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW((void)SubpixelLayout::cells(0, 1, {}), Error);
  EXPECT_THROW((void)SubpixelLayout::cells(65, 1, std::vector<PixelCell>(65)), Error);
  EXPECT_THROW((void)SubpixelLayout::cells(2, 2, std::vector<PixelCell>(3)), Error);
  EXPECT_THROW((void)SubpixelLayout::cells(1, 1, {PixelCell{{{nan, 0}, {}, {}}}}), Error);
  EXPECT_THROW((void)SubpixelLayout::cells(1, 1, {PixelCell{{{2.5, 0}, {}, {}}}}), Error);
  EXPECT_THROW((void)SubpixelLayout::named("rgbw"), Error);
}

TEST(Panel, HasItsOriginInTheCentreAndYUp) {
  Panel panel{.width_px = 100,
              .height_px = 50,
              .pixel_width = Millimetres(0.5),
              .pixel_height = Millimetres(0.25),
              .layout = {}};
  EXPECT_EQ(panel.x_mm(50.0), 0.0);
  EXPECT_EQ(panel.y_mm(25.0), 0.0);
  EXPECT_EQ(panel.x_mm(0.0), -25.0);
  EXPECT_EQ(panel.y_mm(0.0), 6.25);
  EXPECT_EQ(panel.x_px(panel.x_mm(12.5)), 12.5);
  EXPECT_EQ(panel.y_px(panel.y_mm(12.5)), 12.5);
}

}  // namespace
}  // namespace lenticule::optics
