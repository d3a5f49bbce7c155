// SPDX-License-Identifier: Apache-2.0
// Whatever may change a subpixel is made neutral, read back, reported and put back.
#include <gmock/gmock.h>

#include <set>

#include "display/kms/exactness_rules.h"
#include "kms_stage.h"

namespace lenticule::testing {

using display::AuditOutcome;
using display::AuditRow;
using display::Verdict;
using ::testing::HasSubstr;

class Exactness : public KmsStage {
 protected:
  Exactness() { connector->type = DRM_MODE_CONNECTOR_VIRTUAL; }

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

  // The kernel drops a blob that nothing refers to: the contents must come back, not the number.
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

TEST_F(Exactness, EnumeratorsAreFoundByNameWhateverTheirNumber) {
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

TEST_F(Exactness, AlphaIsOpaqueAndMarginsAreGone) {
  add_range(card.primary_of(crtc), "alpha", 100, 0xffff);
  add_range(connector->id, "left margin", 20, 100);
  open();
  EXPECT_EQ(card.value(card.primary_of(crtc), "alpha"), 0xffffU);
  EXPECT_EQ(card.value(connector->id, "left margin"), 0U);
}

TEST_F(Exactness, ColourVibranceOfOneIsNotTheMiddleOfItsRange) {
  add_range(connector->id, "color vibrance", 100, 200);
  open();
  EXPECT_EQ(card.value(connector->id, "color vibrance"), 150U);
}

TEST_F(Exactness, RefusedSettingIsFoundAndTheRestIsStillForced) {
  add_enum(connector->id, "underscan", 1, {{"off", 0}, {"on", 1}}).refuses = 0;
  add_range(connector->id, "abm level", 3, 4);
  open();
  EXPECT_EQ(card.value(connector->id, "underscan"), 1U);
  EXPECT_EQ(card.value(connector->id, "abm level"), 0U);
  EXPECT_EQ(row("underscan").outcome, AuditOutcome::Refused);
  EXPECT_EQ(row("abm level").outcome, AuditOutcome::Forced);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
  EXPECT_THAT(show->exactness().summary(), HasSubstr("'underscan' is on"));
  EXPECT_FALSE(show->exactness().remedies.empty());
}

TEST_F(Exactness, DriverThatSaysYesAndDoesNothingIsFoundOut) {
  add_enum(connector->id, "Broadcast RGB", 0, {{"Automatic", 0}, {"Full", 1}}).ignores_writes =
      true;
  open();
  EXPECT_EQ(row("Broadcast RGB").outcome, AuditOutcome::Refused);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, ReadOnlyPropertyIsNeverWrittenButReported) {
  add_enum(connector->id, "panel orientation", 1, {{"Normal", 0}, {"Upside Down", 1}}).flags |=
      DRM_MODE_PROP_IMMUTABLE;
  open();
  EXPECT_EQ(row("panel orientation").outcome, AuditOutcome::ReadOnly);
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
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
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, ScaledPlaneIsNotExact) {
  card.object(card.primary_of(crtc)).find("CRTC_W")->ignores_writes = true;
  open();
  EXPECT_EQ(show->exactness().verdict, Verdict::No);
}

TEST_F(Exactness, SettingsAreForcedAgainAfterSomebodyElseDrew) {
  FakeProperty& abm = add_range(connector->id, "abm level", 0, 4);
  const std::string name = abm.name;
  open();
  flip(1);
  card.object(connector->id).find(name)->value = 3;
  machine.sleep(seconds(10));
  idle(seconds(1));
  EXPECT_EQ(card.value(connector->id, name), 0U);
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

}  // namespace lenticule::testing
