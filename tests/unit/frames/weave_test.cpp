// SPDX-License-Identifier: Apache-2.0
// Tests the conventions of weaving: half pixels, corners, orders, borders.
#include "frames/weave.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lab/reference_weaver.h"
#include "tests/support/error_matchers.h"
#include "tests/support/noise_frame.h"

namespace lenticule::frames {
namespace {

using lab::weave;

using test::error_of;
using ::testing::DoubleNear;
using ::testing::ElementsAre;

/// Returns a rig with square pixels of 0.1 mm and one lens per pixel with its axis at the pixel's
/// centre, seen from far away: every subpixel's ray leaves the panel at its pixel's centre.
optics::Rig one_lens_per_pixel(int width, int height) {
  optics::Rig rig;
  rig.name = "one lens per pixel";
  rig.panel = {.width_px = width,
               .height_px = height,
               .pixel_width = Millimetres(0.1),
               .pixel_height = Millimetres(0.1),
               .layout = optics::SubpixelLayout::rgb()};
  rig.sheet.pitch = Subpixels(3.0);
  rig.sheet.offset = Lenses(width % 2 == 0 ? 0.5 : 0.0);
  rig.sheet.gap = Millimetres(0.3);
  return rig;
}

/// Returns views of one pixel each, whose code is their index + 1, so that 0 means outside.
ViewSet coded_views(int count) {
  std::vector<WovenFrame> views;
  for (int view = 0; view < count; ++view) {
    views.emplace_back(FrameGeometry{.width = 1, .height = 1});
    for (uint8_t& byte : views.back().bytes()) byte = static_cast<uint8_t>(view + 1);
  }
  return ViewSet(std::move(views));
}

const WeaveOptions kCoded{.filter = ViewFilter::Nearest, .fit = PictureFit::Stretch};
const WeaveOptions kReversed{
    .filter = ViewFilter::Nearest, .fit = PictureFit::Stretch, .order = ViewOrder::RightToLeft};

struct Size {
  int width, height;
};
class PanelShape : public ::testing::TestWithParam<Size> {};

TEST_P(PanelShape, APictureOfThePanelsSizeIsUnchanged) {
  const auto [width, height] = GetParam();
  const optics::OpticalModel model(one_lens_per_pixel(width, height));
  const WovenFrame picture = test::noise_frame(width, height, 99);
  const ViewSet views(std::vector<WovenFrame>{picture});
  for (const ViewFilter filter : {ViewFilter::Nearest, ViewFilter::Linear, ViewFilter::Gauss})
    for (const PictureFit fit : {PictureFit::Contain, PictureFit::Cover, PictureFit::Stretch})
      EXPECT_EQ(weave(views, model, {.filter = filter, .fit = fit}), picture)
          << to_string(filter) << ' ' << to_string(fit);
}

TEST_P(PanelShape, AHalvedPanelShowsTheMeansOfTheRightPixels) {
  const auto [width, height] = GetParam();
  const optics::OpticalModel model(one_lens_per_pixel(width, height));
  // The picture has twice the panel's pixels: each panel pixel's centre is the corner of four
  // picture pixels.
  WovenFrame picture({.width = 2 * width, .height = 2 * height});
  const WovenFrame expected = test::noise_frame(width, height, 99);
  for (int y = 0; y < picture.height(); ++y)
    for (int x = 0; x < picture.width() * 3; ++x)
      picture.row(y)[x] = expected.row(y / 2)[x / 6 * 3 + x % 3];
  EXPECT_EQ(weave(ViewSet({picture}), model), expected);
}
INSTANTIATE_TEST_SUITE_P(Shapes, PanelShape,
                         ::testing::Values(Size{16, 9}, Size{9, 16}, Size{4, 3}, Size{7, 7},
                                           Size{1, 5}, Size{64, 2}));

TEST(Weave, MarksInCornersStayInTheirCorners) {
  const optics::OpticalModel model(one_lens_per_pixel(40, 30));
  WovenFrame picture({.width = 8, .height = 6});
  picture.row(0)[0] = 255;                                      // red, top left
  picture.row(0)[7 * 3 + 1] = 255;                              // green, top right
  picture.row(5)[2] = 255;                                      // blue, bottom left
  for (int c = 0; c < 3; ++c) picture.row(5)[7 * 3 + c] = 255;  // white, bottom right
  const WovenFrame woven = weave(ViewSet({picture}), model);
  EXPECT_THAT(std::vector<int>(woven.row(0), woven.row(0) + 3), ElementsAre(255, 0, 0));
  EXPECT_THAT(std::vector<int>(woven.row(0) + 39 * 3, woven.row(0) + 40 * 3),
              ElementsAre(0, 255, 0));
  EXPECT_THAT(std::vector<int>(woven.row(29), woven.row(29) + 3), ElementsAre(0, 0, 255));
  EXPECT_THAT(std::vector<int>(woven.row(29) + 39 * 3, woven.row(29) + 40 * 3),
              ElementsAre(255, 255, 255));
  // Five panel pixels per picture pixel; left and right halves mirror each other.
  for (int i = 0; i < 40; ++i) EXPECT_EQ(woven.row(0)[i * 3], woven.row(29)[(39 - i) * 3]);
  for (int j = 0; j < 30; ++j) EXPECT_EQ(woven.row(j)[0], woven.row(29 - j)[39 * 3]);
}

TEST(Weave, ViewNumbersGrowRightwardForViewersAndLeftwardUnderALens) {
  optics::Rig rig = one_lens_per_pixel(30, 2);
  rig.sheet.pitch = Subpixels(9.0);
  rig.sheet.offset = Lenses(0.5);  // a lens's left edge at the panel's centre
  const optics::OpticalModel model(rig);
  const ViewSet views = coded_views(9);
  const WovenFrame woven = weave(views, model, kCoded);
  // The rightmost subpixel under a lens is seen from the leftmost position, that of camera 0.
  std::vector<int> under_lens(woven.row(0) + 45, woven.row(0) + 54);
  EXPECT_THAT(under_lens, ElementsAre(9, 8, 7, 6, 5, 4, 3, 2, 1));
  const WovenFrame reversed = weave(views, model, kReversed);
  under_lens.assign(reversed.row(0) + 45, reversed.row(0) + 54);
  EXPECT_THAT(under_lens, ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9));
}

TEST(Weave, FractionalPitchesAreNotRounded) {
  optics::Rig rig = one_lens_per_pixel(300, 1);
  rig.sheet.pitch = Subpixels(4.57);
  const optics::OpticalModel model(rig);
  const WovenFrame woven = weave(coded_views(5), model, kCoded);
  for (int s = 0; s < 900; ++s) {
    const double lambda = ((s + 0.5) - 450.0) / 4.57 + rig.sheet.offset.value;
    const double place = lambda - std::floor(lambda + 0.5);
    EXPECT_EQ(woven.row(0)[s], static_cast<int>(std::ceil(5 * (0.5 - place)))) << "subpixel " << s;
  }
}

TEST(Weave, BarsAreBlackOnlyWithContain) {
  const optics::OpticalModel model(one_lens_per_pixel(40, 20));
  WovenFrame white({.width = 4, .height = 4});
  std::fill(white.bytes().begin(), white.bytes().end(), uint8_t{255});
  const ViewSet square(std::vector<WovenFrame>{white});
  const WovenFrame contained = weave(square, model, {.fit = PictureFit::Contain});
  for (const int i : {0, 9}) EXPECT_EQ(contained.row(10)[3 * i + 2], 0) << i;
  for (const int i : {10, 29}) EXPECT_EQ(contained.row(10)[3 * i], 255) << i;
  for (const int i : {30, 39}) EXPECT_EQ(contained.row(10)[3 * i], 0) << i;
  for (const PictureFit fit : {PictureFit::Cover, PictureFit::Stretch}) {
    const WovenFrame filled = weave(square, model, {.fit = fit});
    EXPECT_TRUE(std::all_of(filled.bytes().begin(), filled.bytes().end(),
                            [](uint8_t code) { return code == 255; }));
  }
  const ViewSet wide({white}, 4.0);
  const WovenFrame letters = weave(wide, model, {.fit = PictureFit::Contain});
  EXPECT_EQ(letters.row(4)[60], 0);
  EXPECT_EQ(letters.row(5)[60], 255);
  EXPECT_EQ(letters.row(14)[60], 255);
  EXPECT_EQ(letters.row(15)[60], 0);
}

TEST(Weave, CoverCropsTheSidesEvenly) {
  const optics::OpticalModel model(one_lens_per_pixel(4, 4));
  WovenFrame picture({.width = 8, .height = 4});
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 8; ++i) picture.row(j)[3 * i] = static_cast<uint8_t>(10 * i);
  const WovenFrame woven = weave(ViewSet({picture}), model, {.fit = PictureFit::Cover});
  for (int i = 0; i < 4; ++i) EXPECT_EQ(woven.row(1)[3 * i], 10 * (i + 2));
}

TEST(Weave, ARoundedAspectLeavesNoHairline) {
  const optics::OpticalModel model(one_lens_per_pixel(160, 90));
  WovenFrame white({.width = 16, .height = 9});
  std::fill(white.bytes().begin(), white.bytes().end(), uint8_t{255});
  const WovenFrame woven = weave(ViewSet({white}, 1.777), model);
  EXPECT_TRUE(std::all_of(woven.bytes().begin(), woven.bytes().end(),
                          [](uint8_t code) { return code == 255; }));
}

TEST(Weave, MixesInLinearLight) {
  optics::Rig rig = one_lens_per_pixel(3, 1);
  rig.sheet.pitch = Subpixels(9.0);
  rig.sheet.offset = Lenses(0.0);  // the middle subpixel is on the axis: v = 1 of 2
  std::vector<WovenFrame> views(2, WovenFrame({.width = 1, .height = 1}));
  for (uint8_t& byte : views[1].bytes()) byte = 255;
  const WovenFrame woven = weave(ViewSet(views), optics::OpticalModel(rig),
                                 {.filter = ViewFilter::Linear, .fit = PictureFit::Stretch});
  EXPECT_EQ(woven.row(0)[4], 188) << "the code of half the light, not 128";
}

TEST(NearestView, IsNotMovedOverABorderByRounding) {
  // Whole columns lie on the borders of 6 views at pitch 6 and slant 1/3.
  for (int border = 1; border < 6; ++border) {
    for (const double rounding : {-1e-12, 0.0, 1e-12})
      EXPECT_EQ(nearest_view(border + rounding, 6), border - 1) << border << " " << rounding;
    EXPECT_EQ(nearest_view(border + 1e-6, 6), border);
  }
  EXPECT_EQ(nearest_view(0.0, 6), 0);
  EXPECT_EQ(nearest_view(6.0, 6), 5);
}

TEST(WeaveNames, AreReadAndWritten) {
  for (const char* name : {"nearest", "linear", "gauss"})
    EXPECT_STREQ(to_string(parse_view_filter(name)), name);
  for (const char* name : {"contain", "cover", "stretch"})
    EXPECT_STREQ(to_string(parse_picture_fit(name)), name);
  EXPECT_EQ(error_of([] { (void)parse_view_filter("cubic"); }).kind(), ErrorKind::Usage);
  EXPECT_EQ(error_of([] { (void)parse_picture_fit(""); }).kind(), ErrorKind::Usage);
}

}  // namespace
}  // namespace lenticule::frames
