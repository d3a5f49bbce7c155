// SPDX-License-Identifier: Apache-2.0
// Tests SSIM, MSE and PSNR against their definitions, and the views that eyes see.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "frames/compare.h"
#include "frames/weave.h"
#include "tests/support/error_matchers.h"
#include "tests/support/noise_frame.h"
#include "tests/support/oracles/picture_oracle.h"

namespace lenticule::frames {
namespace {

using test::error_of;

/// Returns soft waves with an error that grows downward.
WovenFrame waves(int width, int height, double error) {
  WovenFrame frame({.width = width, .height = height});
  for (int j = 0; j < height; ++j)
    for (int i = 0; i < width; ++i)
      for (int c = 0; c < 3; ++c) {
        const double wave = 128 + 90 * std::sin(0.3 * i + c) * std::cos(0.2 * j);
        const double wrong = error * j / height * ((i * 7 + j * 13 + c) % 5 - 2);
        frame.row(j)[3 * i + c] = static_cast<uint8_t>(std::clamp(wave + wrong, 0.0, 255.0));
      }
  return frame;
}

TEST(Similarity, IsOneForEqualPicturesOnly) {
  const WovenFrame a = waves(40, 30, 0);
  EXPECT_DOUBLE_EQ(*structural_similarity(a.view(), a.view()), 1.0);
  EXPECT_LT(*structural_similarity(a.view(), waves(40, 30, 10).view()), 1.0);
}

TEST(Similarity, AgreesWithItsDefinition) {
  for (const auto& [width, height] : {std::pair{11, 11}, {12, 30}, {37, 16}}) {
    for (const double error : {0.5, 3.0, 30.0}) {
      const WovenFrame a = waves(width, height, 0);
      const WovenFrame b = waves(width, height, error);
      EXPECT_NEAR(*structural_similarity(a.view(), b.view()),
                  static_cast<double>(test::ssim_by_definition(a.view(), b.view())), 1e-10);
    }
    const WovenFrame a = test::noise_frame(width, height, 1);
    const WovenFrame b = test::noise_frame(width, height, 2);
    const double unlike = *structural_similarity(a.view(), b.view());
    EXPECT_NEAR(unlike, static_cast<double>(test::ssim_by_definition(a.view(), b.view())), 1e-10);
    EXPECT_LT(std::abs(unlike), 0.3);
  }
}

TEST(Similarity, NeedsPicturesOfAtLeastOneWindow) {
  const WovenFrame small = test::noise_frame(10, 40, 1);
  EXPECT_FALSE(structural_similarity(small.view(), small.view()).has_value());
  EXPECT_EQ(error_of([&] {
              (void)structural_similarity(small.view(), test::noise_frame(40, 10, 1).view());
            }).kind(),
            ErrorKind::Input);
}

TEST(Differences, AgreeWithTheirDefinitions) {
  const WovenFrame a = test::noise_frame(23, 9, 5);
  const WovenFrame b = test::noise_frame(23, 9, 6);
  const PictureDifference d = compare_pictures(a.view(), b.view());
  const auto close = [&](const Difference& one, int channel) {
    const auto mse = static_cast<double>(test::mse_by_definition(a.view(), b.view(), channel));
    EXPECT_NEAR(one.mse(), mse, 1e-9 * mse);
    EXPECT_NEAR(one.rmse(), std::sqrt(mse), 1e-9 * mse);
    EXPECT_NEAR(*one.psnr_db(),
                static_cast<double>(test::psnr_by_definition(a.view(), b.view(), channel)), 1e-9);
  };
  for (int channel = 0; channel < 3; ++channel)
    close(d.channels[static_cast<size_t>(channel)], channel);
  close(d.total, -1);
  EXPECT_DOUBLE_EQ(d.total.share_over(8),
                   static_cast<double>(d.total.count_over(8)) / (23.0 * 9 * 3));
}

TEST(ErrorPicture, IsBlackWhereEqualAndWhiteWhereOpposite) {
  WovenFrame a({.width = 3, .height = 1});
  WovenFrame b = a;
  b.row(0)[3 + 1] = 255;  // the middle pixel's green
  b.row(0)[6 + 2] = 8;    // the right one's blue, a little
  const WovenFrame heat = error_picture(a.view(), b.view());
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(heat.row(0)[c], 0);
    EXPECT_EQ(heat.row(0)[3 + c], 255);
  }
  EXPECT_GT(heat.row(0)[6 + 1], 100) << "eight levels are green";
  EXPECT_LT(heat.row(0)[6 + 0], 60);
}

// ---- views as eyes see them

optics::Rig rig(double distance_mm) {
  optics::Rig rig;
  rig.name = "small";
  rig.panel = {.width_px = 60,
               .height_px = 40,
               .pixel_width = Millimetres(0.2),
               .pixel_height = Millimetres(0.2),
               .layout = optics::SubpixelLayout::rgb()};
  rig.sheet.pitch = Subpixels(9.0);
  rig.sheet.slant = 0.2;
  rig.sheet.gap = Millimetres(1.2);
  rig.sheet.spot_sigma = Lenses(0.01);
  rig.viewing.distance = Millimetres(distance_mm);
  return rig;
}

TEST(DecodedView, ShowsTheSubpixelsOfThatView) {
  constexpr int kViews = 3;  // number of subpixels of each channel under a lens
  for (const double distance : {600.0, std::numeric_limits<double>::infinity()}) {
    const optics::OpticalModel model(rig(distance));
    // Every subpixel has the code of its view.
    WovenFrame woven({.width = 60, .height = 40});
    for (int j = 0; j < 40; ++j)
      for (int i = 0; i < 60; ++i)
        for (int c = 0; c < 3; ++c) {
          const double v = optics::view_number(model.ray(i, j, c).place, kViews);
          woven.row(j)[3 * i + c] = static_cast<uint8_t>(60 * static_cast<int>(std::ceil(v)));
        }
    for (int view = 0; view < kViews; ++view) {
      const WovenFrame seen = decode_view(woven.view(), model, view, kViews);
      EXPECT_EQ(seen.geometry(), (FrameGeometry{.width = 20, .height = 13}));
      double error = 0.0;
      int count = 0;
      for (int j = 3; j < 10; ++j)
        for (int b = 9; b < 51; ++b, ++count) error += std::abs(seen.row(j)[b] - 60.0 * (view + 1));
      EXPECT_LT(error / count, 6.0) << "view " << view << " from " << distance;
    }
  }
}

}  // namespace
}  // namespace lenticule::frames
