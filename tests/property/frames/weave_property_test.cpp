// SPDX-License-Identifier: Apache-2.0
// The weaver against the plain long double one: all of a family of tiny rigs, and places of large
// ones including every corner.
#include <gtest/gtest.h>

#include <random>

#include "frames/weave.h"
#include "support/weave_oracle.h"

namespace lenticule::frames {
namespace {

using optics::SubpixelLayout;

WovenFrame noise(int width, int height, uint32_t seed) {
  WovenFrame frame({.width = width, .height = height});
  std::mt19937 random(seed);
  for (uint8_t& byte : frame.bytes()) byte = static_cast<uint8_t>(random());
  return frame;
}

SubpixelLayout two_over_one() {
  return SubpixelLayout::cells(
      2, 1,
      {{{{0.25, 0.25}, {0.75, 0.25}, {0.5, 0.75}}}, {{{0.25, 0.75}, {0.75, 0.75}, {0.5, 0.25}}}});
}

optics::Rig tiny_rig(int width, int height, double pitch, double slant,
                     const SubpixelLayout& layout, double distance) {
  optics::Rig rig;
  rig.name = "tiny";
  rig.panel = {.width_px = width,
               .height_px = height,
               .pixel_width = Millimetres(0.2),
               .pixel_height = Millimetres(0.25),
               .layout = layout};
  rig.sheet.pitch = Subpixels(pitch);
  rig.sheet.slant = slant;
  rig.sheet.offset = Lenses(0.31);
  rig.sheet.gap = Millimetres(1.1);
  rig.sheet.refraction_shape = 0.44;
  rig.sheet.channel_offset = {Subpixels(0.05), Subpixels(0.0), Subpixels(-0.08)};
  rig.sheet.spot_sigma = Lenses(0.1);
  rig.viewing = {.height = Millimetres(20.0), .distance = Millimetres(distance)};
  return rig;
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Setting {
  QuiltLayout layout;
  WeaveOptions options;
};
const Setting kSettings[] = {
    {{.columns = 3, .rows = 2}, {.filter = ViewFilter::Nearest}},
    {{.columns = 3, .rows = 2, .views = 5}, {.filter = ViewFilter::Linear}},
    {{.columns = 1, .rows = 7}, {.filter = ViewFilter::Nearest, .order = ViewOrder::RightToLeft}},
    {{.columns = 7, .rows = 1, .views = 0, .aspect = 3.0},
     {.filter = ViewFilter::Linear, .fit = PictureFit::Cover}},
    {{.columns = 2, .rows = 2, .views = 3, .aspect = 0.4},
     {.filter = ViewFilter::Gauss, .fit = PictureFit::Contain, .order = ViewOrder::RightToLeft}},
    {{.columns = 1, .rows = 1}, {.filter = ViewFilter::Linear, .fit = PictureFit::Stretch}},
};

void expect_oracle(const test::WeaveOracle& oracle, const WovenFrame& woven, int i, int j) {
  for (int c = 0; c < 3; ++c) {
    const auto allowed = oracle.subpixel(i, j, c);
    ASSERT_TRUE(allowed.contains(woven.row(j)[3 * i + c]))
        << "pixel " << i << ", " << j << " channel " << c << ": " << int(woven.row(j)[3 * i + c])
        << ", oracle " << *allowed.begin() << ".." << *allowed.rbegin();
  }
}

TEST(Weave, EqualsThePlainWeaverOnAllTinyRigs) {
  for (const auto& [width, height] : {std::pair{12, 8}, std::pair{5, 9}})
    for (const double pitch : {3.3, 7.71, 24.04})
      for (const double slant : {0.0, 0.2513, -1.0})
        for (const SubpixelLayout& layout :
             {SubpixelLayout::rgb(), SubpixelLayout::bgr(), SubpixelLayout::vrgb(), two_over_one()})
          for (const double distance : {kInfinity, 300.0}) {
            const optics::Rig rig = tiny_rig(width, height, pitch, slant, layout, distance);
            const optics::OpticalModel model(rig);
            for (const Setting& setting : kSettings) {
              const WovenFrame quilt =
                  noise(setting.layout.columns * 7, setting.layout.rows * 5, 17);
              const test::WeaveOracle oracle{rig, quilt, setting.layout, setting.options};
              const WovenFrame woven =
                  weave(ViewSet(quilt, setting.layout), model, setting.options);
              for (int j = 0; j < height; ++j)
                for (int i = 0; i < width; ++i) expect_oracle(oracle, woven, i, j);
              ASSERT_FALSE(::testing::Test::HasFailure())
                  << width << "x" << height << " pitch " << pitch << " slant " << slant << " "
                  << layout.name() << " distance " << distance;
            }
          }
}

TEST(Weave, EqualsThePlainWeaverAtTheCornersOfLargePanels) {
  std::mt19937 random(2024);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int n = 0; n < 12; ++n) {
    const int width = n % 3 == 0 ? 2160 : 7680, height = n % 3 == 0 ? 3840 : 400;
    optics::Rig rig = tiny_rig(width, height, 4.0 + 20.0 * unit(random), 2.0 * unit(random) - 1.0,
                               n % 2 ? SubpixelLayout::bgr() : SubpixelLayout::rgb(),
                               n % 4 == 0 ? kInfinity : 900.0 + 300.0 * unit(random));
    rig.sheet.offset = Lenses(unit(random));
    rig.sheet.gap = Millimetres(2.0 * rig.sheet.pitch.value * 0.2 / 3.0);
    const optics::OpticalModel model(rig);
    // Smooth views: the paraxial height of a lens point is a fraction of a pixel off here.
    const Setting& setting = kSettings[n % 2];
    WovenFrame quilt({.width = setting.layout.columns, .height = setting.layout.rows});
    for (size_t b = 0; b < quilt.bytes().size(); ++b)
      quilt.bytes()[b] = static_cast<uint8_t>(20 + 11 * b);
    const test::WeaveOracle oracle{rig, quilt, setting.layout, setting.options};
    const ViewSet views(quilt, setting.layout);
    const Weaver weaver(views, model, setting.options);
    WovenFrame woven(weaver.geometry());
    for (const int j : {0, height / 2, height - 1}) {
      weaver.weave_rows(j, j + 1, woven);
      for (const int i : {0, 1, width / 2, width - 2, width - 1})
        expect_oracle(oracle, woven, i, j);
      for (int k = 0; k < 40; ++k)
        expect_oracle(oracle, woven, static_cast<int>(unit(random) * width), j);
    }
    ASSERT_FALSE(::testing::Test::HasFailure()) << "rig " << n;
  }
}

TEST(Weave, RowsDoNotDependOnHowTheyAreShared) {
  const optics::Rig rig = tiny_rig(40, 30, 7.71, 0.2513, SubpixelLayout::rgb(), 300.0);
  const optics::OpticalModel model(rig);
  const ViewSet views(noise(21, 10, 5), {.columns = 3, .rows = 2});
  const Weaver weaver(views, model, {});
  WovenFrame by_rows(weaver.geometry());
  for (int j = 29; j >= 0; --j) weaver.weave_rows(j, j + 1, by_rows);
  EXPECT_EQ(by_rows, weave(views, model));
}

}  // namespace
}  // namespace lenticule::frames
