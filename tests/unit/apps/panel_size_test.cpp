// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/lenticule-tools/calibrate/calibrate_result.h"

namespace lenticule::tools {
namespace {

using ::testing::HasSubstr;

optics::Panel panel_of(double pixel_mm) {
  optics::Panel panel;
  panel.width_px = 3840;
  panel.height_px = 2160;
  panel.pixel_width = panel.pixel_height = Millimetres(pixel_mm);
  return panel;
}

TEST(PanelSize, RoundingOfAnEdidIsNoContradiction) {
  constexpr double kPixelMm = 0.15565;  // 597.7 x 336.2 mm
  EXPECT_EQ(size_contradiction(panel_of(kPixelMm), 598, 336), "");
  EXPECT_EQ(size_contradiction(panel_of(kPixelMm), 600, 340), "");
  EXPECT_EQ(size_contradiction(panel_of(kPixelMm), 336, 598), "");  // hangs upright
  EXPECT_EQ(size_contradiction(panel_of(kPixelMm), 0, 0), "");      // not stated
}

TEST(PanelSize, TwoPercentAreNamed) {
  constexpr double kPixelMm = 0.15565;
  EXPECT_THAT(size_contradiction(panel_of(1.02 * kPixelMm), 598, 336), HasSubstr("(+2.0 %)"));
  EXPECT_THAT(size_contradiction(panel_of(0.98 * kPixelMm), 598, 336), HasSubstr("(-2.0 %)"));
}

}  // namespace
}  // namespace lenticule::tools
