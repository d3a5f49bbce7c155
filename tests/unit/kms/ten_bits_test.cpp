// SPDX-License-Identifier: Apache-2.0
// Tests panels of 10 bits per colour: the format of the frames, the link's depth, the check of
// exactness, and cards that lack the format.
#include <gmock/gmock.h>

#include "display/kms/color/exactness_rules.h"
#include "display/kms/inspect.h"
#include "kms_stage.h"
#include "tests/support/error_matchers.h"
#include "tests/support/fakes/scanout_words.h"

namespace lenticule::test {

using display::AuditOutcome;
using display::AuditRow;
using display::ScanoutDepth;
using display::Verdict;
using ::testing::Contains;
using ::testing::HasSubstr;

class TenBits : public KmsStage {
 protected:
  TenBits() {
    card.formats = {DRM_FORMAT_XRGB8888, DRM_FORMAT_XRGB2101010};
    options.output.depth = ScanoutDepth::Bits10;
    card.set_edid(connector->id, EdidMaker{.serial_text = "ONE", .deep_colour = true}.bytes());
  }

  [[nodiscard]] static std::vector<uint32_t> deep_words(unsigned seed) {
    const frames::WovenFrame frame = make_frame(seed);
    std::vector<uint32_t> words;
    for (size_t i = 0; i < frame.bytes().size(); i += 3)
      words.push_back(test::scanout_word(frame.bytes().data() + i, ScanoutDepth::Bits10));
    return words;
  }
  FakeProperty& add_max_bpc(uint64_t value, uint64_t most) {
    return card.add_property(connector->id, {.name = "max bpc",
                                             .flags = DRM_MODE_PROP_RANGE,
                                             .value = value,
                                             .minimum = 6,
                                             .maximum = most});
  }
  [[nodiscard]] uint32_t format_on_screen() {
    const auto shown = static_cast<uint32_t>(card.value(card.primary_of(crtc), "FB_ID"));
    return card.framebuffers.at(shown).format;
  }
  /// Makes the connector an internal panel of i915 that reports this line of its pipe to root.
  void become_edp_of_i915(const std::string& line) {
    card.driver = "i915";
    connector->type = DRM_MODE_CONNECTOR_eDP;
    card.set_edid(connector->id, EdidMaker{.serial_text = "ONE", .bits = 10}.bytes());
    machine.kernel_files["/sys/kernel/debug/dri/0/i915_display_info"] =
        "[CRTC:" + std::to_string(crtc) + ":pipe A]:\n\t" + line + "\n";
    machine.kernel_files["/sys/kernel/debug/dri/0/eDP-1/i915_dsc_fec_support"] =
        "DSC_Enabled: no\n";
  }
  void expect_refused(const std::string& reason, const std::string& remedy) {
    expect_error(failure(), ErrorKind::Quality, reason, remedy);
  }
};

TEST_F(TenBits, FramesAreExpandedIntoScanoutMemory) {
  open();
  EXPECT_EQ(format_on_screen(), DRM_FORMAT_XRGB2101010);
  for (unsigned n = 1; n <= 4; ++n) {
    flip(n);
    EXPECT_EQ(card.displayed(crtc), deep_words(n));
  }
  EXPECT_THAT(show->mode().name, HasSubstr("10 bits per colour"));
}

TEST_F(TenBits, TheLinkIsSetToTenBitsWithTheModeAndRestored) {
  card.show_console(connector->id, crtc);
  add_max_bpc(12, 16).needs_modeset = true;
  card.add_property(connector->id, {.name = "hdmi_output_depth",
                                    .flags = DRM_MODE_PROP_ENUM,
                                    .value = 0,
                                    .enums = {{"Automatic", 0}, {"24bit", 8}, {"30bit", 10}}});
  open();
  EXPECT_EQ(card.value(connector->id, "max bpc"), 10U);
  EXPECT_EQ(card.value(connector->id, "hdmi_output_depth"), 10U);
  EXPECT_EQ(card.modesets, 1);
  show.reset();
  EXPECT_EQ(card.value(connector->id, "max bpc"), 12U);
  EXPECT_EQ(card.value(connector->id, "hdmi_output_depth"), 0U);
}

TEST_F(TenBits, APanelOfEightBitsKeepsTheUsualFormatOnTheSameCard) {
  options.output.depth = ScanoutDepth::Bits8;
  add_max_bpc(12, 16);
  open();
  flip(1);
  expect_displayed(1);
  EXPECT_EQ(format_on_screen(), DRM_FORMAT_XRGB8888);
  EXPECT_EQ(card.value(connector->id, "max bpc"), 8U);
}

TEST_F(TenBits, ACardWithoutTheFormatIsRefused) {
  card.formats = {DRM_FORMAT_XRGB8888};
  expect_refused("cannot scan out 10 bits per colour (XRGB2101010)", "panel.bits = 8");
  EXPECT_EQ(card.modesets + card.blocking_commits, 0) << "before a frame is shown";
}

TEST_F(TenBits, ACardWithoutTheFormatShowsEightBitsIfThatIsAllowed) {
  card.formats = {DRM_FORMAT_XRGB8888};
  add_max_bpc(12, 16);
  options.allow_inexact = true;
  open();
  flip(1);
  expect_displayed(1);
  EXPECT_EQ(card.value(connector->id, "max bpc"), 8U);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("the panel gets 8"));
}

TEST_F(TenBits, ALinkOrAPanelOfFewerBitsIsRefused) {
  add_max_bpc(8, 8);
  expect_refused("carries at most 8 bits per colour", "panel.bits = 8");
  become_edp_of_i915("dither=no, bpp=30");
  card.set_edid(connector->id, EdidMaker{.serial_text = "ONE"}.bytes());
  expect_refused("accepts 8 bits per colour", "panel.bits = 8");
}

TEST_F(TenBits, AnHdmiInputMustStateDeepColour) {
  card.set_edid(connector->id, EdidMaker{.serial_text = "ONE", .bits = 10}.bytes());
  expect_refused("accepts 8 bits per colour", "panel.bits = 8");
  connector->type = DRM_MODE_CONNECTOR_DisplayPort;
  open();
}

TEST_F(TenBits, ADriverThatKeepsTheLinkAtEightBitsIsRefused) {
  add_max_bpc(8, 16).refuses = 10;
  expect_refused("'max bpc' is 8", "another graphics card");
}

TEST_F(TenBits, OfI915AreExactOnlyIfThePipeCarriesThemWithoutDithering) {
  become_edp_of_i915("dither=no, bpp=30");
  open();
  EXPECT_EQ(show->exactness().summary(), "EXACT yes");
  EXPECT_THAT(show->exactness().verified, Contains(HasSubstr("scans XRGB2101010")));
  EXPECT_THAT(show->exactness().verified, Contains(HasSubstr("10 bits per colour (XRGB2101010)")));
  show.reset();
  become_edp_of_i915("dither=no, bpp=24");
  expect_refused("bpp=24", "panel.bits = 8");
  become_edp_of_i915("dither=yes, bpp=30");
  expect_refused("dither", "10 bits");
}

TEST_F(TenBits, OfADriverThatWasReadForEightBitsOnlyAreUnknown) {
  card.driver = "virtio_gpu";
  connector->type = DRM_MODE_CONNECTOR_VIRTUAL;
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
  EXPECT_THAT(show->exactness().unseen, Contains(HasSubstr("XRGB2101010")));
}

TEST_F(TenBits, BehindALegacyGammaRampAreUnknown) {
  become_edp_of_i915("dither=no, bpp=30");
  card.use_legacy_gamma(crtc, 256);
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
  EXPECT_THAT(show->exactness().unseen, Contains(HasSubstr("each 8-bit value only")));
}

TEST_F(TenBits, DoctorTestsTheFormatThatIsAskedFor) {
  display::OutputRequest request;
  request.depth = ScanoutDepth::Bits10;
  auto found = display::diagnose(machine.session(), request, machine.platform());
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].exactness.verified, Contains(HasSubstr("XRGB2101010")));
  card.formats = {DRM_FORMAT_XRGB8888};
  found = display::diagnose(machine.session(), request, machine.platform());
  EXPECT_EQ(found[0].exactness.verdict, Verdict::No);
}

}  // namespace lenticule::test
