// SPDX-License-Identifier: Apache-2.0
#include "frames/compare.h"

#include <gtest/gtest.h>

#include <numeric>

#include "frames/weave.h"
#include "lab/reference_weaver.h"
#include "tests/support/error_matchers.h"

namespace lenticule::frames {
namespace {

using lab::weave;

using test::error_of;

WovenFrame grey(int width, int height, uint8_t code) {
  WovenFrame frame({.width = width, .height = height});
  std::fill(frame.bytes().begin(), frame.bytes().end(), code);
  return frame;
}

optics::Rig small_rig(int width, int height) {
  optics::Rig rig;
  rig.name = "small";
  rig.panel = {.width_px = width,
               .height_px = height,
               .pixel_width = Millimetres(0.2),
               .pixel_height = Millimetres(0.2),
               .layout = optics::SubpixelLayout::rgb()};
  rig.sheet.pitch = Subpixels(7.6);
  rig.sheet.slant = 0.2;
  rig.sheet.gap = Millimetres(1.2);
  return rig;
}

TEST(Compare, ChannelsAreSeparateAndTheTotalIsTheirMean) {
  const WovenFrame reference = grey(10, 1, 100);
  WovenFrame other = reference;
  other.row(0)[0] = 110;     // red, once by 10
  other.row(0)[3 + 2] = 60;  // blue, once by 40
  const PictureDifference d = compare_pictures(reference.view(), other.view());
  EXPECT_DOUBLE_EQ(d.channels[0].mse(), 10.0);
  EXPECT_DOUBLE_EQ(d.channels[1].mse(), 0.0);
  EXPECT_DOUBLE_EQ(d.channels[2].mse(), 160.0);
  EXPECT_DOUBLE_EQ(d.total.mse(), 170.0 / 3.0);
  EXPECT_EQ(d.total.max(), 40);
  EXPECT_EQ(d.total.count_over(8), 2u);
  EXPECT_EQ(d.total.count_over(32), 1u);
}

TEST(Compare, OtherSizesAreAnInputError) {
  EXPECT_EQ(
      error_of([] { (void)compare_pictures(grey(2, 3, 0).view(), grey(3, 2, 0).view()); }).kind(),
      ErrorKind::Input);
  const optics::OpticalModel model(small_rig(8, 6));
  EXPECT_EQ(error_of([&] {
              (void)compare_views(grey(8, 5, 0).view(), grey(8, 5, 0).view(), model, 8);
            }).kind(),
            ErrorKind::Input);
  const WovenFrame right = grey(8, 6, 0);
  for (const int views : {0, -1, 5000})
    EXPECT_EQ(
        error_of([&] { (void)compare_views(right.view(), right.view(), model, views); }).kind(),
        ErrorKind::Usage);
}

TEST(CompareViews, OnlyADamagedViewIsReported) {
  const optics::OpticalModel model(small_rig(60, 40));
  std::vector<WovenFrame> pictures(6, grey(1, 1, 80));
  const WeaveOptions options{.filter = ViewFilter::Nearest, .fit = PictureFit::Stretch};
  const WovenFrame reference = weave(ViewSet(pictures), model, options);
  pictures[4] = grey(1, 1, 95);
  const WovenFrame damaged = weave(ViewSet(pictures), model, options);

  const auto views = compare_views(reference.view(), damaged.view(), model, 6);
  ASSERT_EQ(views.size(), 6u);
  EXPECT_EQ(worst_view(views), 4);
  for (int view = 0; view < 6; ++view)
    EXPECT_DOUBLE_EQ(views[size_t(view)].mse(), view == 4 ? 225.0 : 0.0) << "view " << view;
  const uint64_t samples =
      std::accumulate(views.begin(), views.end(), uint64_t{0},
                      [](uint64_t sum, const Difference& d) { return sum + d.samples(); });
  EXPECT_EQ(samples, 60u * 40u * 3u) << "every subpixel belongs to one view";
}

TEST(CompareViews, CountsOneViewPerSubpixelUnderALens) {
  EXPECT_EQ(native_view_count(small_rig(8, 6)), 8);
}

}  // namespace
}  // namespace lenticule::frames
