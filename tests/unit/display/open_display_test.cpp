// SPDX-License-Identifier: Apache-2.0
#include "display/open/open_display.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/error_matchers.h"

namespace lenticule::display {
namespace {

constexpr frames::FrameGeometry kPanel{.width = 64, .height = 36};

ErrorKind kind_of_failure(const std::string& spec) {
  const Error error = test::error_of([&] {
    (void)open_display(
        {.spec = spec, .panel = kPanel, .clock = std::make_shared<SimulatedClock>()});
  });
  EXPECT_NE(std::string(error.what()).find(spec), std::string::npos) << error.what();
  return error.kind();
}

TEST(OpenDisplay, ReadsEveryPartOfAVirtualSpec) {
  EXPECT_EQ(parse_virtual_spec("virtual"), VirtualSpec{});
  EXPECT_EQ(parse_virtual_spec("virtual:3840x2160"), (VirtualSpec{.width = 3840, .height = 2160}));
  EXPECT_EQ(parse_virtual_spec("virtual:3840x2160@59.94"),
            (VirtualSpec{.width = 3840, .height = 2160, .refresh = {60000, 1001}}));
  EXPECT_EQ(
      parse_virtual_spec("virtual:8x4@50,jitter_us=500,seed=9"),
      (VirtualSpec{.width = 8, .height = 4, .refresh = {50, 1}, .jitter_us = 500, .seed = 9}));
  EXPECT_EQ(parse_virtual_spec("virtual,jitter_us=500").jitter_us, 500);
}

TEST(OpenDisplay, RefusesInvalidSpecs) {
  for (const char* spec :
       {"", "virtua", "virtualx", "virtual:", "virtual:0x0@60", "virtual:64", "virtual:64x",
        "virtual:-64x36", "virtual:64x36x2", "virtual:99999999999x36", "virtual:64x36,jitter_us=-1",
        "virtual:64x36,jitter_us=x", "virtual:64x36,colour=blue"})
    EXPECT_EQ(kind_of_failure(spec), ErrorKind::Usage) << spec;
  EXPECT_THROW(check_display_spec("virtual:64x36@0"), Error);
  EXPECT_NO_THROW(check_display_spec("kms:HDMI-A-1"));
}

TEST(OpenDisplay, IsThePanelsSizeByDefault) {
  const auto display = open_display(
      {.spec = "virtual", .panel = kPanel, .clock = std::make_shared<SimulatedClock>()});
  EXPECT_EQ(display->mode().geometry, kPanel);
  EXPECT_EQ(display->mode().refresh, (frames::Rate{60, 1}));
  EXPECT_EQ(display->mode().name, "virtual 64x36@60");
  EXPECT_FALSE(display->mode().hardware_clock);
}

TEST(OpenDisplay, RefusesAnotherSizeThanThePanels) {
  EXPECT_EQ(kind_of_failure("virtual:32x36@60"), ErrorKind::Input);
}

TEST(OpenDisplay, OfATurnedPanelShowsFramesAsTheViewerSeesThem) {
  optics::Rig rig;
  rig.panel.width_px = 36;
  rig.panel.height_px = 64;
  rig.panel.mounting = optics::mounting_named("90");
  for (const char* spec : {"virtual", "virtual:64x36"}) {
    DisplayRequest request = request_for(rig, spec);
    request.clock = std::make_shared<SimulatedClock>();
    const auto display = open_display(request);
    EXPECT_EQ(display->mode().geometry, (frames::FrameGeometry{.width = 36, .height = 64}));
    EXPECT_TRUE(display->mode().name.starts_with("virtual 64x36")) << display->mode().name;
  }
  EXPECT_THROW((void)open_display(request_for(rig, "virtual:36x64")), Error);
  const KmsOptions kms = kms_options_of(request_for(rig, "kms"));
  EXPECT_EQ(kms.output.panel, (frames::FrameGeometry{.width = 64, .height = 36}));
  EXPECT_EQ(kms.mounting, rig.panel.mounting);
}

TEST(OpenDisplay, OfAPanelOfTenBitsHasThemInScanoutMemory) {
  optics::Rig rig;
  rig.panel.width_px = 64;
  rig.panel.height_px = 36;
  EXPECT_EQ(kms_options_of(request_for(rig, "kms")).output.depth, ScanoutDepth::Bits8);
  rig.panel.bits = 10;
  EXPECT_EQ(kms_options_of(request_for(rig, "kms")).output.depth, ScanoutDepth::Bits10);
  DisplayRequest request = request_for(rig, "virtual");
  request.clock = std::make_shared<SimulatedClock>();
  EXPECT_EQ(open_display(request)->mode().name, "virtual 64x36@60, 10 bits per colour");
}

TEST(OpenDisplay, RefusesAMissingPanel) {
  test::expect_error(
      test::error_of([] { (void)open_display({.spec = "kms:Nonsense-77", .panel = kPanel}); }),
      ErrorKind::Device);
}

TEST(OpenDisplay, RefusesInvalidKmsSpecs) {
  for (const char* spec : {"kms:nodash", "kms:edid:", "kms:DP 1-", "kmsx"})
    EXPECT_THROW(check_display_spec(spec), Error) << spec;
}

TEST(OpenDisplay, DistinguishesKmsSpecs) {
  EXPECT_TRUE(is_kms_spec("kms"));
  EXPECT_TRUE(is_kms_spec("kms:DP-1"));
  EXPECT_FALSE(is_kms_spec("kmsx"));
  EXPECT_FALSE(is_kms_spec("virtual:64x36"));
}

}  // namespace
}  // namespace lenticule::display
