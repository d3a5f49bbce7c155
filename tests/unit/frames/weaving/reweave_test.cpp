// SPDX-License-Identifier: Apache-2.0
#include "frames/weaving/reweave.h"

#include <gtest/gtest.h>

#include <cmath>

#include "frames/weaving/fast_weaver.h"
#include "tests/support/error_matchers.h"

namespace lenticule::frames {
namespace {

using test::error_of;

optics::Rig rig_of(double pitch, double slant, double offset) {
  optics::Rig rig;
  rig.name = "reweave";
  rig.panel = {.width_px = 640,
               .height_px = 360,
               .pixel_width = Millimetres(0.2),
               .pixel_height = Millimetres(0.2),
               .layout = optics::SubpixelLayout::rgb()};
  rig.sheet.pitch = Subpixels(pitch);
  rig.sheet.slant = slant;
  rig.sheet.offset = Lenses(offset);
  rig.sheet.gap = Millimetres(2.0);
  rig.sheet.refraction_shape = 0.44;
  rig.viewing.distance = Millimetres(600.0);
  return rig;
}

/// Returns waves that move a little from view to view; a wave is `lenses` lenses long.
ViewSet waves(int count, double lenses) {
  constexpr int kWidth = 320, kHeight = 180;
  const double per_pixel = 2.0 * M_PI / (lenses * kWidth / 250.0);
  std::vector<WovenFrame> views;
  for (int view = 0; view < count; ++view) {
    views.emplace_back(FrameGeometry{.width = kWidth, .height = kHeight});
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth * 3; ++x) {
        const double phase = per_pixel * (x / 3 + 0.3 * y) + 1.5 * view / count + x % 3;
        views.back().row(y)[x] = static_cast<uint8_t>(std::lround(128.0 + 70.0 * std::sin(phase)));
      }
  }
  return ViewSet(std::move(views));
}

double psnr(const WovenFrame& a, const WovenFrame& b) {
  double squares = 0.0;
  for (size_t n = 0; n < a.bytes().size(); ++n)
    squares += std::pow(double(a.bytes()[n]) - double(b.bytes()[n]), 2);
  return 10.0 * std::log10(255.0 * 255.0 * static_cast<double>(a.bytes().size()) / squares);
}

double reweave_psnr(const optics::Rig& from, const optics::Rig& to, double lenses) {
  const optics::OpticalModel a(from), b(to);
  const ViewSet views = waves(16, lenses);
  const WovenFrame woven = weave_fast(views, a);
  const ViewSet decoded = views_of_woven(woven.view(), a, views_in_woven(from));
  return psnr(weave_fast(decoded, b), weave_fast(views, b));
}

TEST(Reweave, KeepsSmoothPicturesAndLosesDetailBelowALens) {
  const optics::Rig from = rig_of(7.71, 0.2513, 0.3), to = rig_of(8.33, -0.1667, 0.1);
  const double smooth = reweave_psnr(from, to, 25.0), detailed = reweave_psnr(from, to, 5.0);
  RecordProperty("smooth_db", std::to_string(smooth));
  RecordProperty("detailed_db", std::to_string(detailed));
  EXPECT_GT(smooth, 40.0);
  EXPECT_GT(detailed, 23.0);
  EXPECT_GT(smooth, detailed + 3.0);
}

TEST(Reweave, KeepsTheOrderOfViews) {
  // Each view has one colour, so that only the order and the lobe's start can be wrong.
  const optics::OpticalModel a(rig_of(8.0, 0.25, 0.3));
  std::vector<WovenFrame> coded(8, WovenFrame({.width = 4, .height = 4}));
  for (size_t view = 0; view < coded.size(); ++view)
    for (uint8_t& byte : coded[view].bytes()) byte = static_cast<uint8_t>(20 + 30 * view);
  const WovenFrame woven = weave_fast(ViewSet(coded), a, {.fit = PictureFit::Stretch});
  const ViewSet decoded = views_of_woven(woven.view(), a, 8);
  for (int view = 1; view < 7; ++view) {
    double sum = 0.0;
    for (int row = 0; row < decoded.height(); ++row) sum += decoded.pixel(view, 100, row)[1];
    EXPECT_NEAR(sum / decoded.height(), 20 + 30 * view, 6) << view;
  }
}

TEST(Reweave, RefusesFramesOfAnotherPanel) {
  const optics::OpticalModel model(rig_of(8.0, 0.25, 0.3));
  const WovenFrame other({.width = 64, .height = 64});
  EXPECT_EQ(error_of([&] { (void)views_of_woven(other.view(), model, 4); }).kind(),
            ErrorKind::Input);
  EXPECT_EQ(views_in_woven(model.rig()), 8);
}

}  // namespace
}  // namespace lenticule::frames
