// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.h"
#include "display/kms/probe/output_choice.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/fake_drm.h"

namespace lenticule::test {

using display::ConnectorInfo;
using display::EdidProblem;
using display::PixelSize;

constexpr frames::FrameGeometry kUhd{3840, 2160, frames::PixelFormat::Rgb8};

drmModeModeInfo with_clock(uint32_t kilohertz, bool preferred) {
  drmModeModeInfo mode = make_mode(3840, 2160, 60, preferred);
  mode.htotal = 4400;
  mode.vtotal = 2250;
  mode.clock = kilohertz;
  return mode;
}

/// Returns the chosen mode if the panel's own size is unknown.
std::optional<drmModeModeInfo> choose_mode(const std::vector<drmModeModeInfo>& modes,
                                           const frames::FrameGeometry& panel,
                                           std::optional<frames::Rate> refresh) {
  const ConnectorInfo connector{.modes = modes};
  return display::choose_mode(connector, panel, refresh);
}

/// Returns a connector whose EDID could be read.
ConnectorInfo panel_of(const std::vector<drmModeModeInfo>& modes,
                       std::optional<PixelSize> first_timing = std::nullopt) {
  return {.name = "HDMI-A-1",
          .modes = modes,
          .edid = {.problem = EdidProblem::None, .base_native = first_timing}};
}

TEST(ModeChoice, RefreshIsTheExactFraction) {
  EXPECT_EQ(display::refresh_of(with_clock(594000, true)), frames::make_rate(60, 1));
  EXPECT_EQ(display::refresh_of(with_clock(593407, true)), frames::make_rate(593407, 9900));
}

TEST(ModeChoice, PreferredModeWinsUnlessARefreshIsRequested) {
  const std::vector<drmModeModeInfo> modes = {with_clock(594000, false), with_clock(593407, true),
                                              with_clock(297000, false)};
  EXPECT_EQ(choose_mode(modes, kUhd, std::nullopt)->clock, 593407U);
  EXPECT_EQ(choose_mode(modes, kUhd, frames::make_rate(60, 1))->clock, 594000U);
  EXPECT_EQ(choose_mode(modes, kUhd, frames::parse_rate("59.94"))->clock, 593407U);
  EXPECT_EQ(choose_mode(modes, kUhd, frames::make_rate(30, 1))->clock, 297000U);
  EXPECT_FALSE(choose_mode(modes, kUhd, frames::make_rate(50, 1)));
}

TEST(ModeChoice, ARequestFor60HzMatchesAModeOf59Point997Hz) {
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

TEST(ModeChoice, ListedSizeThatIsNotThePanelsOwnIsNeverUsed) {
  constexpr frames::FrameGeometry full_hd{1920, 1080, frames::PixelFormat::Rgb8};
  const ConnectorInfo panel =
      panel_of({with_clock(594000, true), make_mode(1920, 1080, 60, false)});
  EXPECT_TRUE(display::choose_mode(panel, kUhd, std::nullopt));
  EXPECT_FALSE(display::choose_mode(panel, full_hd, std::nullopt));
  EXPECT_FALSE(display::offers_mode(panel, make_mode(1920, 1080, 60)));
  const Error error =
      test::error_of([&] { (void)display::require_mode(panel, full_hd, std::nullopt); });
  EXPECT_EQ(error.kind(), ErrorKind::Input);
  EXPECT_STREQ(error.what(),
               "HDMI-A-1: the panel would scale 1920x1080 to its own 3840x2160, which would "
               "destroy the views");
  EXPECT_NE(error.hint().find("own rig"), std::string::npos);
}

TEST(ModeChoice, KernelsPreferenceCountsBeforeTheEdidsTiming) {
  // The kernel has quirks for panels with a wrong EDID.
  const ConnectorInfo panel = panel_of({with_clock(594000, true)}, PixelSize{1920, 1080});
  EXPECT_EQ(display::native_sizes(panel), std::vector<PixelSize>({{3840, 2160}}));
}

TEST(ModeChoice, TimingOfTheEdidCountsWithoutAPreferredMode) {
  // The cable is too slow for the preferred mode: the kernel drops the mode, and the size stays.
  const std::vector<drmModeModeInfo> modes = {with_clock(297000, false),
                                              make_mode(1920, 1080, 60, false)};
  const ConnectorInfo panel = panel_of(modes, PixelSize{3840, 2160});
  EXPECT_EQ(display::choose_mode(panel, kUhd, std::nullopt)->clock, 297000U);
  EXPECT_FALSE(display::choose_mode(panel, {1920, 1080, frames::PixelFormat::Rgb8}, std::nullopt));
}

TEST(ModeChoice, WithoutAnEdidAnyListedSizeFitsAndThePreferredModeWins) {
  // Drivers of virtual machines list sizes and prefer one of them.
  for (const EdidProblem problem : {EdidProblem::Absent, EdidProblem::BadChecksum}) {
    const ConnectorInfo output{
        .modes = {make_mode(1024, 768, 60), with_clock(594000, false), with_clock(297000, false)},
        .edid = {.problem = problem}};
    EXPECT_TRUE(display::native_sizes(output).empty());
    EXPECT_EQ(display::choose_mode(output, kUhd, std::nullopt)->clock, 594000U);
  }
  const ConnectorInfo output{.modes = {with_clock(594000, false), with_clock(297000, true)}};
  EXPECT_EQ(display::choose_mode(output, kUhd, std::nullopt)->clock, 297000U);
}

TEST(ModeChoice, OfEqualModesTheSlowerClockIsTaken) {
  drmModeModeInfo reduced = with_clock(0, false);
  reduced.htotal = 4000;
  reduced.vtotal = 2222;
  reduced.clock = 533280;
  EXPECT_EQ(choose_mode({with_clock(594000, false), reduced}, kUhd, std::nullopt)->clock, 533280U);
}

}  // namespace lenticule::test
