// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.h"
#include "optics/panel.h"
#include "optics/rig.h"
#include "tests/support/noise_frame.h"
#include "tests/support/random_rigs.h"
#include "tests/support/turned_picture.h"

namespace lenticule::optics {
namespace {

class EveryMounting : public testing::TestWithParam<const char*> {
 protected:
  const Mounting mounting = mounting_named(GetParam());
};

TEST_P(EveryMounting, KeepsItsName) {
  EXPECT_EQ(mounting_name(mounting), GetParam());
  EXPECT_EQ(mounting.upright(), std::string(GetParam()) == "0");
}

TEST_P(EveryMounting, TurnsEveryPixelAsItsNameSays) {
  const frames::WovenFrame sent = test::noise_frame(7, 4, 1);
  const frames::WovenFrame seen = test::seen_of(sent, GetParam());
  const PixelGrid size = mounting.turned({sent.width(), sent.height()});
  ASSERT_EQ(size, (PixelGrid{seen.width(), seen.height()}));
  for (int j = 0; j < sent.height(); ++j)
    for (int i = 0; i < sent.width(); ++i) {
      const PixelPlace at = mounting.seen_place({i, j}, size);
      for (int c = 0; c < 3; ++c)
        EXPECT_EQ(seen.row(at.row)[3 * at.column + c], sent.row(j)[3 * i + c]) << i << ", " << j;
    }
}

TEST_P(EveryMounting, IsUndoneByItsInverse) {
  EXPECT_TRUE(combined(mounting, mounting.inverse()).upright());
  EXPECT_TRUE(combined(mounting.inverse(), mounting).upright());
}

TEST_P(EveryMounting, CombinesWithEveryOtherAsPicturesDo) {
  const frames::WovenFrame sent = test::noise_frame(5, 3, 2);
  for (const char* second : test::kMountingNames)
    EXPECT_EQ(test::seen_of(sent, mounting_name(combined(mounting, mounting_named(second)))),
              test::seen_of(test::seen_of(sent, GetParam()), second))
        << second;
}

TEST_P(EveryMounting, OfAPanelLeavesOtherRigsFingerprints) {
  Rig rig = test::kiosk_rig();
  const std::string before = fingerprint(rig);
  rig.panel.mounting = mounting;
  EXPECT_EQ(fingerprint(rig), before) << "woven frames do not depend on the mounting";
}

INSTANTIATE_TEST_SUITE_P(Mountings, EveryMounting, testing::ValuesIn(test::kMountingNames));

TEST(Mounting, RefusesOtherNames) {
  for (const char* name : {"", "45", "-90", "360", "90 mirrored", "mirrored  90", "upside down"})
    EXPECT_THROW((void)mounting_named(name), Error) << name;
}

TEST(TurnedLayout, NamesStripesAsTheViewerSeesThem) {
  const auto name_of = [](const char* layout, const char* mounting) {
    return turned_layout(SubpixelLayout::named(layout), mounting_named(mounting), {10, 6}).name();
  };
  EXPECT_EQ(name_of("rgb", "90"), "vrgb");
  EXPECT_EQ(name_of("rgb", "180"), "bgr");
  EXPECT_EQ(name_of("rgb", "270"), "vbgr");
  EXPECT_EQ(name_of("rgb", "mirrored"), "bgr");
  EXPECT_EQ(name_of("vrgb", "90"), "bgr");
  EXPECT_EQ(name_of("bgr", "mirrored 180"), "bgr");
}

TEST(TurnedRig, OfAHalfTurnIsExactThereAndBack) {
  const Rig kiosk = test::kiosk_rig();
  const Rig down = turned_rig(kiosk, mounting_named("180"));
  EXPECT_EQ(down.sheet.pitch, kiosk.sheet.pitch);
  EXPECT_EQ(down.sheet.slant, kiosk.sheet.slant);
  EXPECT_EQ(down.panel.layout.name(), "bgr");
  EXPECT_EQ(turned_rig(down, {}), kiosk);
}

TEST(TurnedRig, BehindAMirrorLeansTheOtherWay) {
  const Rig kiosk = test::kiosk_rig();
  const Rig seen = turned_rig(kiosk, mounting_named("mirrored"));
  EXPECT_EQ(seen.sheet.slant, -kiosk.sheet.slant);
  EXPECT_EQ(seen.panel.sent_size(), (PixelGrid{3840, 2160}));
}

TEST(TurnedRig, OfAQuarterTurnExchangesWidthAndHeight) {
  Rig rig = test::kiosk_rig();
  rig.sheet.slant = 2.5;
  rig.panel.pixel_height = Millimetres(0.16);
  const Rig portrait = turned_rig(rig, mounting_named("90"));
  EXPECT_EQ(portrait.panel.width_px, 2160);
  EXPECT_EQ(portrait.panel.height_px, 3840);
  EXPECT_EQ(portrait.panel.pixel_width.value, 0.16);
  EXPECT_EQ(portrait.panel.sent_size(), (PixelGrid{3840, 2160}));
  EXPECT_EQ(portrait.panel.layout.name(), "vrgb");
}

TEST(TurnedRig, RefusesLensesAcrossTheViewersEyes) {
  try {
    (void)turned_rig(test::upright_rig(), mounting_named("90"));
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::Input);
    EXPECT_FALSE(error.hint().empty());
  }
}

}  // namespace
}  // namespace lenticule::optics
