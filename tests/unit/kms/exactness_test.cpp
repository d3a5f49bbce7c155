// SPDX-License-Identifier: Apache-2.0
// Tests that every property that can change a subpixel is made neutral, read back, reported and
// restored.
#include <gmock/gmock.h>

#include <set>

#include "display/kms/color/exactness_rules.h"
#include "display/kms/device/connector.h"
#include "kms_stage.h"
#include "tests/support/error_matchers.h"

namespace lenticule::test {

using display::AuditOutcome;
using display::AuditRow;
using display::Verdict;
using ::testing::Contains;
using ::testing::HasSubstr;

class Exactness : public KmsStage {
 protected:
  Exactness() {
    connector->type = DRM_MODE_CONNECTOR_VIRTUAL;
    card.driver = "virtio_gpu";  // known to pass frames on unchanged
  }

  void open_even_if_inexact() {
    options.allow_inexact = true;
    open();
  }
  /// Expects opening to fail for this reason, and the panel to show nothing of ours.
  void expect_refused(const std::string& reason) {
    expect_error(failure(), ErrorKind::Quality, reason, "--allow-inexact");
  }
  void become_edp_of(const std::string& intel_driver) {
    card.driver = intel_driver;
    connector->type = DRM_MODE_CONNECTOR_eDP;
  }
  [[nodiscard]] std::string debugfs(const std::string& file) const {
    return "/sys/kernel/debug/dri/0/" + file;
  }
  [[nodiscard]] std::string crtc_section(const std::string& text) const {
    return "[CRTC:1:pipe Z]:\n\tdither=yes, bpp=18\n[CRTC:" + std::to_string(crtc) +
           ":pipe A]:\n\t" + text + "\n";
  }
  /// Adds the debug files in which an i915 run by root reports its complete pipeline.
  void report_all_in_debugfs() {
    machine.kernel_files[debugfs("i915_display_info")] =
        crtc_section("pipe src=24x6+0+0, dither=no, bpp=24");
    machine.kernel_files[debugfs("eDP-1/i915_dsc_fec_support")] =
        "DSC_Enabled: no\nDSC_Sink_Support: no\n";
  }

  FakeProperty& add_enum(uint32_t object, const std::string& name, uint64_t value,
                         std::vector<std::pair<std::string, uint64_t>> enums) {
    return card.add_property(
        object, {.name = name, .flags = DRM_MODE_PROP_ENUM, .value = value, .enums = enums});
  }
  FakeProperty& add_range(uint32_t object, const std::string& name, uint64_t value, uint64_t most) {
    return card.add_property(
        object, {.name = name, .flags = DRM_MODE_PROP_RANGE, .value = value, .maximum = most});
  }
  AuditRow row(const std::string& property) {
    for (const AuditRow& row : show->exactness().rows)
      if (row.property == property) return row;
    ADD_FAILURE() << "no row " << property;
    return {};
  }
};

TEST_F(Exactness, VirtualOutputWithNeutralPropertiesIsExact) {
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  EXPECT_EQ(show->exactness().summary(), "EXACT yes");
}

TEST_F(Exactness, InheritedColourStateIsClearedAndRestored) {
  card.show_console(connector->id, crtc);
  const uint32_t lut = card.add_blob({1, 2, 3});
  const uint32_t hdr = card.add_blob({9, 9});
  for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"})
    card.object(crtc).find(name)->value = lut;
  card.add_property(connector->id,
                    {.name = "HDR_OUTPUT_METADATA", .flags = DRM_MODE_PROP_BLOB, .value = hdr});
  add_enum(connector->id, "Colorspace", 9, {{"Default", 0}, {"BT2020_RGB", 9}});
  open();
  for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"}) {
    EXPECT_EQ(card.value(crtc, name), 0U) << name;
    EXPECT_EQ(row(name).outcome, AuditOutcome::Forced);
    EXPECT_EQ(row(name).found, "set");
  }
  EXPECT_EQ(card.value(connector->id, "HDR_OUTPUT_METADATA"), 0U);
  EXPECT_EQ(card.value(connector->id, "Colorspace"), 0U);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);

  // The kernel drops a blob without users: the contents must be restored, not the number.
  card.blobs.erase(lut);
  card.blobs.erase(hdr);
  show.reset();
  for (const char* name : {"GAMMA_LUT", "DEGAMMA_LUT", "CTM"})
    EXPECT_EQ(card.blobs[static_cast<uint32_t>(card.value(crtc, name))],
              (std::vector<uint8_t>{1, 2, 3}));
  EXPECT_EQ(card.blobs[static_cast<uint32_t>(card.value(connector->id, "HDR_OUTPUT_METADATA"))],
            (std::vector<uint8_t>{9, 9}));
  EXPECT_EQ(card.value(connector->id, "Colorspace"), 9U);
}

TEST_F(Exactness, PlaneColourPipelineOfAnotherProgramIsBypassedAndRestored) {
  const uint32_t plane = card.primary_of(crtc);
  card.show_console(connector->id, crtc);
  add_enum(plane, "COLOR_PIPELINE", 41, {{"Bypass", 0}, {"Color Pipeline 41", 41}});
  open();
  EXPECT_EQ(card.value(plane, "COLOR_PIPELINE"), 0U);
  EXPECT_EQ(row("COLOR_PIPELINE").found, "Color Pipeline 41");
  EXPECT_EQ(row("COLOR_PIPELINE").outcome, AuditOutcome::Forced);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  show.reset();
  EXPECT_EQ(card.value(plane, "COLOR_PIPELINE"), 41U);
}

TEST_F(Exactness, PlaneColourPipelineWithoutBypassIsUnknown) {
  add_enum(card.primary_of(crtc), "COLOR_PIPELINE", 41, {{"Color Pipeline 41", 41}});
  open();
  EXPECT_EQ(row("COLOR_PIPELINE").outcome, AuditOutcome::Foreign);
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
}

// Since Linux 6.11 the kernel itself adds "Broadcast RGB" to connectors of vc4, and later of
// others.
TEST_F(Exactness, FullRangeIsForcedOnEveryDriverOfHdmi) {
  connector->type = DRM_MODE_CONNECTOR_HDMIA;
  for (const char* driver : {"vc4", "amdgpu", "brandnew"}) {
    card.driver = driver;
    FakeProperty& range = add_enum(connector->id, "Broadcast RGB", 2,
                                   {{"Automatic", 0}, {"Full", 1}, {"Limited 16:235", 2}});
    open();
    EXPECT_EQ(range.value, 1U) << driver;
    EXPECT_THAT(show->exactness().verified, Contains(HasSubstr("full range"))) << driver;
    show.reset();
    card.object(connector->id).properties.pop_back();
  }
}

TEST_F(Exactness, BacklightThatSysfsControlsIsSwitchedOff) {
  add_enum(connector->id, "adaptive backlight modulation", 5,
           {{"sysfs", 5}, {"off", 0}, {"min", 1}, {"max", 4}});
  open();
  EXPECT_EQ(card.value(connector->id, "adaptive backlight modulation"), 0U);
  EXPECT_EQ(row("adaptive backlight modulation").outcome, AuditOutcome::Forced);
}

TEST_F(Exactness, DitheringPropertiesOfEveryDriverAreSwitchedOff) {
  add_enum(connector->id, "dither", 1, {{"off", 0}, {"on", 1}});
  add_enum(connector->id, "dithering mode", 2, {{"auto", 2}, {"off", 0}});
  add_enum(connector->id, "dithering depth", 3, {{"auto", 3}, {"off", 0}, {"8 bpc", 1}});
  open();
  for (const char* name : {"dither", "dithering mode", "dithering depth"})
    EXPECT_EQ(card.value(connector->id, name), 0U) << name;
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
}

TEST_F(Exactness, EnumeratorsAreFoundByNameForAnyNumber) {
  add_enum(connector->id, "Broadcast RGB", 3, {{"Limited 16:235", 3}, {"Full", 17}});
  add_enum(connector->id, "underscan", 1, {{"on", 1}, {"off", 5}});
  card.add_property(card.primary_of(crtc), {.name = "rotation",
                                            .flags = DRM_MODE_PROP_BITMASK,
                                            .value = 1U << 2,
                                            .enums = {{"rotate-180", 2}, {"rotate-0", 4}}});
  open();
  EXPECT_EQ(card.value(connector->id, "Broadcast RGB"), 17U);
  EXPECT_EQ(card.value(connector->id, "underscan"), 5U);
  EXPECT_EQ(card.value(card.primary_of(crtc), "rotation"), 1U << 4);
}

TEST_F(Exactness, NamesMatchExactly) {
  add_range(connector->id, "max bpc extra", 12, 16);
  add_range(connector->id, "max bpc", 12, 16);
  open();
  EXPECT_EQ(card.value(connector->id, "max bpc"), 8U);
  EXPECT_EQ(card.value(connector->id, "max bpc extra"), 12U);
}

TEST_F(Exactness, SetsOpaqueAlphaAndNoMargins) {
  add_range(card.primary_of(crtc), "alpha", 100, 0xffff);
  add_range(connector->id, "left margin", 20, 100);
  open();
  EXPECT_EQ(card.value(card.primary_of(crtc), "alpha"), 0xffffU);
  EXPECT_EQ(card.value(connector->id, "left margin"), 0U);
}

TEST_F(Exactness, NeutralColourVibranceIsOneAndNotTheMiddleOfItsRange) {
  add_range(connector->id, "color vibrance", 100, 200);
  open();
  EXPECT_EQ(card.value(connector->id, "color vibrance"), 150U);
}

TEST_F(Exactness, RefusedSettingIsFoundAndTheRestIsStillForced) {
  add_enum(connector->id, "underscan", 1, {{"off", 0}, {"on", 1}}).refuses = 0;
  add_range(connector->id, "abm level", 3, 4);
  open_even_if_inexact();
  EXPECT_EQ(card.value(connector->id, "underscan"), 1U);
  EXPECT_EQ(card.value(connector->id, "abm level"), 0U);
  EXPECT_EQ(row("underscan").outcome, AuditOutcome::Refused);
  EXPECT_EQ(row("abm level").outcome, AuditOutcome::Forced);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("'underscan' is on"));
  EXPECT_FALSE(show->exactness().remedies.empty());
}

TEST_F(Exactness, DriverThatIgnoresWritesIsDetected) {
  add_enum(connector->id, "Broadcast RGB", 0, {{"Automatic", 0}, {"Full", 1}}).ignores_writes =
      true;
  open_even_if_inexact();
  EXPECT_EQ(row("Broadcast RGB").outcome, AuditOutcome::Refused);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, ReadOnlyPropertyIsNeverWrittenButReported) {
  add_enum(connector->id, "privacy-screen hw-state", 1, {{"Disabled", 0}, {"Enabled", 1}}).flags |=
      DRM_MODE_PROP_IMMUTABLE;
  open_even_if_inexact();
  EXPECT_EQ(row("privacy-screen hw-state").outcome, AuditOutcome::ReadOnly);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, PanelThatIsBuiltInTurnedIsARemarkAndExact) {
  add_enum(connector->id, "panel orientation", 1, {{"Normal", 0}, {"Upside Down", 1}}).flags |=
      DRM_MODE_PROP_IMMUTABLE;
  open();
  EXPECT_EQ(row("panel orientation").outcome, AuditOutcome::ReadOnly);
  EXPECT_NE(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().remarks, Contains(HasSubstr("Upside Down")));
  EXPECT_THAT(show->exactness().remedies, Contains(HasSubstr("panel.mounting")));
}

TEST_F(Exactness, UnknownNeutralValueIsUnknown) {
  add_enum(connector->id, "color format", 4, {{"weird", 4}});
  open();
  EXPECT_EQ(row("color format").outcome, AuditOutcome::Foreign);
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
}

TEST_F(Exactness, RealLinkIsUnknownBecauseItCannotBeReadBack) {
  connector->type = DRM_MODE_CONNECTOR_HDMIA;
  card.set_edid(connector->id, EdidMaker{.serial_text = "ONE", .ycbcr = true}.bytes());
  open();
  const auto report = show->exactness();
  EXPECT_EQ(report.verdict, Verdict::Unknown);
  EXPECT_THAT(report.summary(), HasSubstr("YCbCr"));
  EXPECT_THAT(report.summary(), HasSubstr("full range"));
}

TEST_F(Exactness, CompressingAdapterIsNotExact) {
  card.driver = "evdi";
  open_even_if_inexact();
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, ScaledPlaneIsNotExact) {
  card.object(card.primary_of(crtc)).find("CRTC_W")->ignores_writes = true;
  open_even_if_inexact();
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, SettingsAreForcedAgainAfterAnotherProgramWasMaster) {
  FakeProperty& abm = add_range(connector->id, "abm level", 0, 4);
  const std::string name = abm.name;
  open();
  flip(1);
  card.object(connector->id).find(name)->value = 3;
  machine.sleep(seconds(10));
  idle(seconds(1));
  EXPECT_EQ(card.value(connector->id, name), 0U);
}

// --- refused or reported ------------------------------------------------------------------

TEST_F(Exactness, DriverThatConvertsColoursIsRefusedBeforeTheFirstFrame) {
  for (const display::DriverPath& path : display::driver_paths()) {
    if (path.kind != display::PathKind::Alters) continue;
    card.driver = path.driver;
    expect_refused(path.fact);
    EXPECT_EQ(card.modesets + card.blocking_commits, 0) << path.driver;
  }
}

TEST_F(Exactness, CirrusIsReportedAsReducingColours) {
  card.driver = "cirrus";
  expect_refused("RGB565");
  open_even_if_inexact();
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("driver cirrus"));
}

TEST_F(Exactness, AnyPanelOnSpiIsRefused) {
  card.driver = "some-new-panel";
  connector->type = DRM_MODE_CONNECTOR_SPI;
  expect_refused("RGB565");
}

TEST_F(Exactness, UnknownDriverHasUnknownExactness) {
  card.driver = "brandnew";
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("brandnew"));
}

TEST_F(Exactness, RefusedOutputIsRestored) {
  card.show_console(connector->id, crtc);
  const uint64_t console = card.value(card.primary_of(crtc), "FB_ID");
  add_enum(connector->id, "Broadcast RGB", 0, {{"Automatic", 0}, {"Full", 1}}).ignores_writes =
      true;
  options.exit = display::ExitPolicy::Hold;
  expect_refused("Broadcast RGB");
  EXPECT_EQ(card.value(card.primary_of(crtc), "FB_ID"), console);
}

TEST_F(Exactness, AnalogueLinkIsNotExact) {
  connector->type = DRM_MODE_CONNECTOR_VGA;
  expect_refused("analogue");
}

TEST_F(Exactness, ExactVerdictListsItsEvidence) {
  open();
  const auto report = show->exactness();
  EXPECT_THAT(report.verified, Contains(HasSubstr("driver virtio_gpu")));
  EXPECT_THAT(report.verified, Contains(HasSubstr("pixel for pixel")));
  EXPECT_THAT(report.verified, Contains(HasSubstr("'GAMMA_LUT' is none")));
  EXPECT_TRUE(report.reasons.empty());
  EXPECT_TRUE(report.unseen.empty());
}

// --- not covered by any property ------------------------------------------------------------

TEST_F(Exactness, RealLinkIsExactOnlyIfTheDriverReportsEverything) {
  become_edp_of("i915");
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
  EXPECT_THAT(show->exactness().unseen, Contains(HasSubstr("DSC")));
  EXPECT_THAT(show->exactness().unseen, Contains(HasSubstr("dithering")));
  show.reset();
  report_all_in_debugfs();
  open();
  EXPECT_EQ(show->exactness().summary(), "EXACT yes");
}

TEST_F(Exactness, RealLinkOfXeIsExactIfTheDriverReportsEverything) {
  become_edp_of("xe");
  report_all_in_debugfs();
  open();
  EXPECT_EQ(show->exactness().summary(), "EXACT yes");
}

TEST_F(Exactness, CompressedLinkIsNotExact) {
  become_edp_of("i915");
  report_all_in_debugfs();
  machine.kernel_files[debugfs("eDP-1/i915_dsc_fec_support")] = "DSC_Enabled: yes\n";
  expect_refused("'DSC' is yes");
  machine.kernel_files.clear();
  machine.kernel_files[debugfs("eDP-1/dsc_clock_en")] = std::string("1\n\0\0", 4);
  card.driver = "amdgpu";
  expect_refused("'DSC' is 1");
}

TEST_F(Exactness, DitheredOrShallowLinkIsNotExact) {
  become_edp_of("i915");
  report_all_in_debugfs();
  machine.kernel_files[debugfs("i915_display_info")] = crtc_section("dither=yes, bpp=18");
  expect_refused("dither");
}

TEST_F(Exactness, PanelOfSixBitsIsNotExact) {
  connector->type = DRM_MODE_CONNECTOR_eDP;
  auto edid = EdidMaker{.serial_text = "ONE"}.bytes();
  edid[20] = 0x95;
  edid[127] = static_cast<uint8_t>(edid[127] + 0xa5 - 0x95);
  card.set_edid(connector->id, edid);
  expect_refused("6 bits per colour");
}

TEST_F(Exactness, PowerSavingThatFollowsThePictureIsNotExact) {
  machine.kernel_files["/sys/class/drm/card0-Virtual-1/amdgpu/panel_power_savings"] = "3\n";
  expect_refused("panel_power_savings");
  machine.kernel_files["/sys/class/drm/card0-Virtual-1/amdgpu/panel_power_savings"] = "0\n";
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
}

TEST_F(Exactness, SelfRefreshIsReportedAndStaysExact) {
  become_edp_of("i915");
  report_all_in_debugfs();
  machine.kernel_files[debugfs("eDP-1/i915_psr_status")] =
      "Sink support: yes\nPSR mode: PSR1 enabled\n";
  machine.kernel_files[debugfs("i915_drrs_status")] = crtc_section("DRRS Enabled: yes");
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  EXPECT_THAT(show->exactness().remarks, Contains(HasSubstr("PSR")));
  EXPECT_THAT(show->exactness().remarks, Contains(HasSubstr("DRRS")));
}

TEST_F(Exactness, ReducedRefreshIsAlsoReadFromTheFileOfTheCrtc) {
  become_edp_of("i915");
  report_all_in_debugfs();
  machine.kernel_files[debugfs("crtc-0/i915_drrs_status")] =
      "DRRS capable: yes\nDRRS enabled: yes\nDRRS active: yes\n";
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  EXPECT_THAT(show->exactness().remarks, Contains(HasSubstr("DRRS")));
}

TEST_F(Exactness, RockchipSendsRgbOfFullRange) {
  connector->type = DRM_MODE_CONNECTOR_HDMIA;
  add_enum(connector->id, "hdmi_output_format", 1, {{"output_rgb", 0}, {"output_ycbcr444", 1}});
  add_enum(connector->id, "hdmi_quant_range", 0, {{"default", 0}, {"limit", 1}, {"full", 2}});
  open();
  EXPECT_EQ(card.value(connector->id, "hdmi_output_format"), 0U);
  EXPECT_EQ(card.value(connector->id, "hdmi_quant_range"), 2U);
  EXPECT_THAT(show->exactness().verified, Contains(HasSubstr("send RGB")));
  EXPECT_THAT(show->exactness().verified, Contains(HasSubstr("full range")));
}

TEST_F(Exactness, TelevisionPropertiesWithAKnownCentreAreCentred) {
  for (const char* knob : {"brightness", "contrast", "saturation", "hue"}) {
    add_range(connector->id, knob, 70, 100);
    add_range(card.primary_of(crtc), knob, 30, 100);
  }
  open();
  for (const char* knob : {"brightness", "contrast", "saturation", "hue"}) {
    EXPECT_EQ(card.value(connector->id, knob), 50U);
    EXPECT_EQ(card.value(card.primary_of(crtc), knob), 50U);
  }
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
}

TEST_F(Exactness, TelevisionPropertyOfAnotherRangeIsUnknown) {
  add_range(connector->id, "brightness", 70, 255);
  open();
  EXPECT_EQ(card.value(connector->id, "brightness"), 70U);
  EXPECT_EQ(show->exactness().verdict, Verdict::Unknown);
}

TEST_F(Exactness, AnotherNativeSizeInTheEdidIsUnknown) {
  connector->type = DRM_MODE_CONNECTOR_eDP;
  card.set_edid(connector->id,
                EdidMaker{.serial_text = "ONE", .width = 3840, .height = 2160}.bytes());
  open();
  EXPECT_THAT(show->exactness().unseen, Contains(HasSubstr("bridge")));
}

TEST(TelevisionModes, ModeThatComesAs420OnlyIsFoundByItsTimings) {
  drmModeModeInfo mode = make_mode(3840, 2160, 60);
  mode.htotal = 4400;
  mode.vtotal = 2250;
  mode.clock = 594000;
  const std::vector<uint8_t> vics = {97};
  EXPECT_TRUE(display::is_one_of(mode, vics));
  EXPECT_FALSE(display::is_one_of(mode, std::vector<uint8_t>{96}));
  mode.clock = 593407;  // 59.94
  EXPECT_TRUE(display::is_one_of(mode, vics));
  mode.htotal = 4000;  // the same size with reduced blanking is another mode
  mode.vtotal = 2222;
  mode.clock = 533250;
  EXPECT_FALSE(display::is_one_of(mode, vics));
}

// --- while playing --------------------------------------------------------------------------

TEST_F(Exactness, PropertyThatIsChangedWhilePlayingIsPutBack) {
  open();
  flip(1);
  card.object(crtc).find("GAMMA_LUT")->value = card.add_blob({1, 2, 3});
  idle(seconds(4));
  EXPECT_EQ(card.value(crtc, "GAMMA_LUT"), 0U);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  EXPECT_EQ(show->statistics().modesets, 1U);
}

TEST_F(Exactness, ChangeThatCannotBePutBackIsReportedAndPlayingContinues) {
  add_enum(connector->id, "privacy-screen hw-state", 0, {{"Disabled", 0}, {"Enabled", 1}}).flags |=
      DRM_MODE_PROP_IMMUTABLE;
  open();
  flip(1);
  EXPECT_EQ(show->exactness().verdict, Verdict::Yes);
  card.object(connector->id).find("privacy-screen hw-state")->value = 1;
  idle(seconds(4));
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  flip(2);
  EXPECT_EQ(show->statistics().modesets, 0U);
}

TEST_F(Exactness, HotplugEventTriggersTheAuditEarlier) {
  open();
  machine.kernel_files["/sys/class/drm/card0-Virtual-1/amdgpu/panel_power_savings"] = "2\n";
  machine.announce_hotplug();
  idle(milliseconds(500));
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, DriverThatKeepsItsValueGetsOneModesetOnly) {
  open();
  FakeProperty* gamma = card.object(crtc).find("GAMMA_LUT");
  gamma->value = card.add_blob({1});
  gamma->ignores_writes = true;
  idle(seconds(60));
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_EQ(show->statistics().modesets, 1U);
}

TEST(DriverPaths, EachIsNamedOnceWithItsSource) {
  std::set<std::string> seen;
  for (const display::DriverPath& path : display::driver_paths()) {
    EXPECT_TRUE(seen.insert(path.driver).second) << path.driver;
    EXPECT_FALSE(std::string(path.fact).empty()) << path.driver;
    EXPECT_THAT(path.source, HasSubstr(" ")) << path.driver;
  }
}

TEST(ExactnessRules, NameEachPropertyOfAnObjectOnce) {
  std::set<std::pair<int, std::string>> seen;
  for (const display::ExactnessRule& rule : display::exactness_rules()) {
    EXPECT_TRUE(seen.emplace(static_cast<int>(rule.object), rule.property).second) << rule.property;
    EXPECT_LT(std::string(rule.property).size(), size_t{DRM_PROP_NAME_LEN});
    EXPECT_NE(rule.effect, nullptr);
    EXPECT_NE(rule.remedy, nullptr);
  }
}

}  // namespace lenticule::test
