// SPDX-License-Identifier: Apache-2.0
#include "display/kms/device/edid.h"

#include <gtest/gtest.h>

#include "tests/support/fakes/fake_drm.h"

namespace lenticule::test {

using display::EdidProblem;
using display::read_edid;

TEST(Edid, GivesMakerProductSerialAndName) {
  const auto reading = read_edid(
      EdidMaker{.manufacturer = "SAM", .product = 0xbeef, .serial_number = 77, .serial_text = "H4Z"}
          .bytes());
  ASSERT_EQ(reading.problem, EdidProblem::None);
  EXPECT_EQ(reading.identity->manufacturer, "SAM");
  EXPECT_EQ(reading.identity->product, 0xbeefU);
  EXPECT_EQ(reading.identity->serial_number, 77U);
  EXPECT_EQ(reading.identity->serial_text, "H4Z");
  EXPECT_EQ(reading.identity->name, "Panel");
  EXPECT_EQ(reading.identity->serial(), "H4Z");
}

TEST(Edid, HashesItsBaseBlock) {
  const auto bytes = EdidMaker{}.bytes();
  const auto reading = read_edid(bytes);
  EXPECT_EQ(reading.identity->sha256.size(), 64U);
  auto longer = bytes;
  longer.resize(256, 0);
  EXPECT_EQ(read_edid(longer).identity->sha256, reading.identity->sha256);
  EXPECT_NE(read_edid(EdidMaker{.serial_number = 1}.bytes()).identity->sha256,
            reading.identity->sha256);
}

TEST(Edid, ProblemsAreNamedAndGiveNoIdentity) {
  auto bytes = EdidMaker{}.bytes();
  EXPECT_EQ(read_edid({}).problem, EdidProblem::Absent);
  EXPECT_EQ(read_edid(std::span(bytes).first(127)).problem, EdidProblem::Short);
  bytes[100] ^= 1;
  EXPECT_EQ(read_edid(bytes).problem, EdidProblem::BadChecksum);
  EXPECT_FALSE(read_edid(bytes).identity);
  bytes[0] = 1;
  EXPECT_EQ(read_edid(bytes).problem, EdidProblem::BadHeader);
}

TEST(Edid, MakerCodesWithoutLettersKeepTheirNumber) {
  auto bytes = EdidMaker{}.bytes();
  const auto set = [&](size_t at, uint8_t value) {
    bytes[127] = static_cast<uint8_t>(bytes[127] + bytes[at] - value);
    bytes[at] = value;
  };
  set(8, 0);
  set(9, 0);
  EXPECT_EQ(read_edid(bytes).identity->manufacturer, "@@@");
  set(8, 0x7f);
  set(9, 0xfb);
  EXPECT_EQ(read_edid(bytes).identity->manufacturer, "__[");
  EXPECT_TRUE(
      display::matches({.manufacturer = "???", .product = {}, .serial = {}, .edid_sha256 = {}},
                       *read_edid(bytes).identity))
      << "as rigs of earlier versions have it";
}

TEST(Edid, UnprintableTextIsLeftOut) {
  const auto reading = read_edid(EdidMaker{.name = "A\x1b[31mB\x07"}.bytes());
  EXPECT_EQ(reading.identity->name, "A[31mB");
}

TEST(Edid, DetectsPanelsThatAcceptYcbcr) {
  EXPECT_FALSE(read_edid(EdidMaker{}.bytes()).offers_ycbcr);
  EXPECT_TRUE(read_edid(EdidMaker{.ycbcr = true}.bytes()).offers_ycbcr);
  auto with_extension = EdidMaker{}.bytes();
  with_extension.resize(256, 0);
  with_extension[128] = 2;
  with_extension[128 + 1] = 3;
  with_extension[128 + 2] = 4;
  EXPECT_FALSE(read_edid(with_extension).offers_ycbcr);
  with_extension[128 + 3] = 0x20;
  EXPECT_TRUE(read_edid(with_extension).offers_ycbcr);
  with_extension.resize(200);
  EXPECT_FALSE(read_edid(with_extension).offers_ycbcr) << "half an extension says nothing";
}

TEST(Edid, DetectsHdmiInputsOfTenBitsPerColour) {
  EXPECT_FALSE(read_edid(EdidMaker{.bits = 10}.bytes()).deep_colour);
  EXPECT_EQ(read_edid(EdidMaker{.bits = 10}.bytes()).bits_per_colour, 10);
  auto deep = EdidMaker{.deep_colour = true}.bytes();
  EXPECT_TRUE(read_edid(deep).deep_colour);
  deep[128 + 10] = 0x20;  // 36 bits per pixel only
  EXPECT_FALSE(read_edid(deep).deep_colour);
  deep[128 + 10] = 0x30;
  deep[128 + 5] = 0x04;  // a vendor's block
  EXPECT_FALSE(read_edid(deep).deep_colour);
}

TEST(Edid, FirstDetailedTimingGivesThePanelsSize) {
  EXPECT_EQ(read_edid(EdidMaker{.width = 3840, .height = 2160}.bytes()).base_native,
            (display::PixelSize{3840, 2160}));
  EXPECT_EQ(read_edid(EdidMaker{.width = 4095, .height = 15}.bytes()).base_native,
            (display::PixelSize{4095, 15}));
  EXPECT_FALSE(read_edid(EdidMaker{}.bytes()).base_native);
  EXPECT_FALSE(
      read_edid(EdidMaker{.width = 1920, .height = 540, .interlaced = true}.bytes()).base_native);
  auto damaged = EdidMaker{.width = 3840, .height = 2160}.bytes();
  damaged[60] ^= 1;
  EXPECT_FALSE(read_edid(damaged).base_native);
}

TEST(Edid, RigMatchesByEveryMemberThatItNames) {
  const auto panel = *read_edid(EdidMaker{.serial_number = 9}.bytes()).identity;
  EXPECT_TRUE(display::matches(optics::PanelIdentity{}, panel));
  optics::PanelIdentity wanted{
      .manufacturer = "LGD", .product = 0x1234, .serial = "9", .edid_sha256 = {}};
  EXPECT_TRUE(display::matches(wanted, panel)) << "a serial number counts as well as its text";
  wanted.serial = std::string("8");
  EXPECT_FALSE(display::matches(wanted, panel));
  wanted.serial.clear();
  wanted.edid_sha256 = std::string(64, '0');
  EXPECT_FALSE(display::matches(wanted, panel));
  wanted.edid_sha256 = panel.sha256;
  wanted.product = 1;
  EXPECT_FALSE(display::matches(wanted, panel));
}

}  // namespace lenticule::test
