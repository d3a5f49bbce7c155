// SPDX-License-Identifier: Apache-2.0
#include "display/kms/mode_choice.h"

#include <gtest/gtest.h>

#include "tests/support/fake_drm.h"

namespace lenticule::testing {

using display::choose_mode;

constexpr frames::FrameGeometry kUhd{3840, 2160, frames::PixelFormat::Rgb8};

drmModeModeInfo with_clock(uint32_t kilohertz, bool preferred) {
  drmModeModeInfo mode = make_mode(3840, 2160, 60, preferred);
  mode.htotal = 4400;
  mode.vtotal = 2250;
  mode.clock = kilohertz;
  return mode;
}

TEST(ModeChoice, RefreshIsTheExactFraction) {
  EXPECT_EQ(display::refresh_of(with_clock(594000, true)), frames::make_rate(60, 1));
  EXPECT_EQ(display::refresh_of(with_clock(593407, true)), frames::make_rate(593407, 9900));
}

TEST(ModeChoice, PreferredModeWinsUnlessARefreshIsAskedFor) {
  const std::vector<drmModeModeInfo> modes = {with_clock(594000, false), with_clock(593407, true),
                                              with_clock(297000, false)};
  EXPECT_EQ(choose_mode(modes, kUhd, std::nullopt)->clock, 593407U);
  EXPECT_EQ(choose_mode(modes, kUhd, frames::make_rate(60, 1))->clock, 594000U);
  EXPECT_EQ(choose_mode(modes, kUhd, frames::parse_rate("59.94"))->clock, 593407U);
  EXPECT_EQ(choose_mode(modes, kUhd, frames::make_rate(30, 1))->clock, 297000U);
  EXPECT_FALSE(choose_mode(modes, kUhd, frames::make_rate(50, 1)));
}

TEST(ModeChoice, AlmostSixtyIsMeantBySixty) {
  const std::vector<drmModeModeInfo> modes = {with_clock(593970, true)};  // 59.997 Hz
  EXPECT_TRUE(choose_mode(modes, kUhd, frames::make_rate(60, 1)));
}

TEST(ModeChoice, OtherSizesInterlacedAndDoubledLinesNeverFit) {
  drmModeModeInfo interlaced = with_clock(594000, true);
  interlaced.flags = DRM_MODE_FLAG_INTERLACE;
  drmModeModeInfo doubled = with_clock(594000, true);
  doubled.flags = DRM_MODE_FLAG_DBLSCAN;
  drmModeModeInfo scanned = with_clock(594000, true);
  scanned.vscan = 2;
  drmModeModeInfo impossible = with_clock(594000, true);
  impossible.htotal = 0;
  EXPECT_FALSE(choose_mode({interlaced, doubled, scanned, impossible, make_mode(1920, 1080, 60)},
                           kUhd, std::nullopt));
}

TEST(ModeChoice, OfEqualModesTheSlowerClockIsTaken) {
  drmModeModeInfo reduced = with_clock(0, false);
  reduced.htotal = 4000;
  reduced.vtotal = 2222;
  reduced.clock = 533280;
  EXPECT_EQ(choose_mode({with_clock(594000, false), reduced}, kUhd, std::nullopt)->clock, 533280U);
}

}  // namespace lenticule::testing
