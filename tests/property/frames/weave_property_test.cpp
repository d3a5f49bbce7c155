// SPDX-License-Identifier: Apache-2.0
// Tests the weaver against a plain one in long double: all rigs of a tiny family, and places of
// large ones including every corner.
#include <gtest/gtest.h>

#include <random>

#include "frames/weave.h"
#include "lab/reference_weaver.h"
#include "tests/support/oracles/weave_oracle.h"
#include "tests/support/weave_rigs.h"

namespace lenticule::frames {
namespace {

using lab::weave;

using optics::SubpixelLayout;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Returns a rig with rectangular pixels and shifted colours.
optics::Rig tiny_rig(int width, int height, double pitch, double slant,
                     const SubpixelLayout& layout, double distance) {
  optics::Rig rig = test::weave_rig(width, height, pitch, slant, distance, layout);
  rig.panel.pixel_height = Millimetres(0.25);
  rig.sheet.gap = Millimetres(1.1);
  rig.sheet.channel_offset = {Subpixels(0.05), Subpixels(0.0), Subpixels(-0.08)};
  rig.sheet.spot_sigma = Lenses(0.1);
  return rig;
}

/// Returns few views, since the reference is slow, but all filters, fits and orders.
std::span<const test::WeaveSetting> few_views() { return test::weave_settings().first(6); }

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
        for (const SubpixelLayout& layout : {SubpixelLayout::rgb(), SubpixelLayout::bgr(),
                                             SubpixelLayout::vrgb(), test::two_over_one()})
          for (const double distance : {kInfinity, 300.0}) {
            const optics::Rig rig = tiny_rig(width, height, pitch, slant, layout, distance);
            const optics::OpticalModel model(rig);
            for (const test::WeaveSetting& setting : few_views()) {
              const WovenFrame quilt = setting.noise();
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
    // The views are smooth, since the paraxial height of a lens point is off by a fraction of a
    // pixel here.
    const test::WeaveSetting& setting = few_views()[static_cast<size_t>(n % 2)];
    WovenFrame quilt({.width = setting.layout.columns, .height = setting.layout.rows});
    for (size_t b = 0; b < quilt.bytes().size(); ++b)
      quilt.bytes()[b] = static_cast<uint8_t>(20 + 11 * b);
    const test::WeaveOracle oracle{rig, quilt, setting.layout, setting.options};
    const ViewSet views(quilt, setting.layout);
    WovenFrame woven({.width = width, .height = height});
    for (const int j : {0, height / 2, height - 1}) {
      lab::weave_rows(views, model, setting.options, j, j + 1, woven);
      for (const int i : {0, 1, width / 2, width - 2, width - 1})
        expect_oracle(oracle, woven, i, j);
      for (int k = 0; k < 40; ++k)
        expect_oracle(oracle, woven, static_cast<int>(unit(random) * width), j);
    }
    ASSERT_FALSE(::testing::Test::HasFailure()) << "rig " << n;
  }
}

TEST(Weave, RowsDoNotDependOnTheirDistributionToThreads) {
  const optics::Rig rig = tiny_rig(40, 30, 7.71, 0.2513, SubpixelLayout::rgb(), 300.0);
  const optics::OpticalModel model(rig);
  const ViewSet views(test::weave_noise(21, 10, 5), {.columns = 3, .rows = 2});
  WovenFrame by_rows({.width = 40, .height = 30});
  for (int j = 29; j >= 0; --j) lab::weave_rows(views, model, {}, j, j + 1, by_rows);
  EXPECT_EQ(by_rows, weave(views, model));
}

}  // namespace
}  // namespace lenticule::frames
