// SPDX-License-Identifier: Apache-2.0
// Tests the whole path: numbered views, woven, seen through the lenses. An eye in the middle of
// view k's zone sees view k, at the panel's edges too, and with few views hardly any other one.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "frames/srgb.h"
#include "frames/weave.h"
#include "lab/reference_weaver.h"
#include "optics/eye_simulator.h"
#include "tests/support/oracles/seen_column.h"

namespace lenticule::frames {
namespace {

using lab::weave;

struct Kiosk {
  const char* name;
  double slant;
  double distance_mm;
};
class SeenViews : public ::testing::TestWithParam<Kiosk> {};

optics::Rig rig_of(const Kiosk& kiosk) {
  optics::Rig rig;
  rig.name = kiosk.name;
  rig.panel = {.width_px = 3840,
               .height_px = 24,
               .pixel_width = Millimetres(0.15567),
               .pixel_height = Millimetres(0.15567),
               .layout = optics::SubpixelLayout::rgb()};
  // Eight subpixels of each colour under a lens: the nearest one is well within a quarter of the
  // lens.
  rig.sheet.pitch = Subpixels(24.04);
  rig.sheet.slant = kiosk.slant;
  rig.sheet.offset = Lenses(0.3);
  rig.sheet.gap = Millimetres(6.98);
  rig.sheet.refraction_shape = 4.0 / 9.0;
  rig.viewing.distance = Millimetres(kiosk.distance_mm);
  return rig;
}

TEST_P(SeenViews, MatchTheEyesPlaceInNearlyAllLenses) {
  const optics::OpticalModel model(rig_of(GetParam()));
  constexpr int kViews = 4;
  std::vector<WovenFrame> pictures;
  for (int view = 0; view < kViews; ++view) {
    pictures.emplace_back(FrameGeometry{.width = 1, .height = 1});
    for (uint8_t& byte : pictures.back().bytes()) byte = static_cast<uint8_t>(view + 1);
  }
  const WovenFrame woven =
      weave(ViewSet(pictures), model, {.filter = ViewFilter::Nearest, .fit = PictureFit::Stretch});

  const double distance = GetParam().distance_mm;
  for (int view = 0; view < kViews; ++view) {
    const double share = (view + 0.5) / kViews - 0.5;
    const optics::Eye eye{.x = share * model.lobe_width_mm(distance), .y = 0.0, .z_mm = distance};
    int seen = 0, right = 0;
    for (int j = 0; j < woven.height(); j += 5)
      for (int64_t lens = -245; lens <= 245; ++lens)
        for (int c = 0; c < 3; ++c) {
          const int column = optics::seen_column(model, lens, j, c, eye);
          if (column < 0) continue;
          ++seen;
          right += woven.row(j)[3 * column + c] == view + 1;
        }
    ASSERT_GT(seen, 5 * 3 * 450);
    EXPECT_GE(right, 0.999 * seen) << "view " << view << ": " << right << " of " << seen;
  }
}
INSTANTIATE_TEST_SUITE_P(Kiosks, SeenViews,
                         ::testing::Values(Kiosk{"Slanted", 0.2521, 700.0},
                                           Kiosk{"SlantedTheOtherWay", -0.2521, 700.0},
                                           Kiosk{"Upright", 0.0, 700.0}),
                         [](const auto& kiosk) { return std::string(kiosk.param.name); });

// --- the default filter ------------------------------------------------------------------------

/// Part of the panel of scenes/rigs/kiosk-27-1080.toml. Its lobe is 125 mm wide.
class DefaultFilter : public ::testing::Test {
 protected:
  DefaultFilter() : model_(rig()) {}

  static optics::Rig rig() {
    optics::Rig rig = rig_of({.name = "kiosk", .slant = 0.2521, .distance_mm = 700.0});
    rig.panel.width_px = 480;
    rig.panel.pixel_width = rig.panel.pixel_height = Millimetres(0.31134);
    rig.sheet.pitch = Subpixels(7.701);
    rig.sheet.gap = Millimetres(4.476);
    return rig;
  }

  /// Weaves `views` views, of which one is white and all others are black.
  [[nodiscard]] WovenFrame woven(int views, int white,
                                 std::optional<ViewFilter> filter = {}) const {
    std::vector<WovenFrame> pictures(static_cast<size_t>(views),
                                     WovenFrame(FrameGeometry{.width = 1, .height = 1}));
    std::ranges::fill(pictures[static_cast<size_t>(white)].bytes(), uint8_t{255});
    return weave(ViewSet(pictures), model_, {.filter = filter, .fit = PictureFit::Stretch});
  }

  /// Returns the codes that an eye at `x_mm` sees, without the columns at the panel's edges.
  [[nodiscard]] std::vector<uint8_t> seen(const WovenFrame& frame, double x_mm) const {
    const optics::RgbPicture picture =
        simulate_eye(model_,
                     {frame.bytes().data(), frame.width(), frame.height(),
                      3 * static_cast<size_t>(frame.width())},
                     {.x = x_mm, .y = 0.0, .z_mm = 700.0}, {.width = 120, .height = 12});
    std::vector<uint8_t> codes;
    for (size_t row = 0; row < 12; ++row)
      for (size_t n = 3 * 10; n < 3 * 110; ++n) codes.push_back(picture.pixels[360 * row + n]);
    return codes;
  }

  /// Returns the mean light for an eye whose place in the lobe has this view number.
  [[nodiscard]] double light(const WovenFrame& frame, double view_number, int views) const {
    const double x_mm = (view_number / views - 0.5) * model_.lobe_width_mm(700.0);
    double sum = 0.0;
    const std::vector<uint8_t> codes = seen(frame, x_mm);
    for (const uint8_t code : codes) sum += linear_of_codes()[code];
    return sum / static_cast<double>(codes.size());
  }

  optics::OpticalModel model_;
};

TEST_F(DefaultFilter, ShowsEachEyeItsPictureOfAPairAlone) {
  const WovenFrame pair = woven(2, 0);
  EXPECT_EQ(std::ranges::min(seen(pair, -32.0)), 255);
  EXPECT_EQ(std::ranges::max(seen(pair, 32.0)), 0);
}

TEST_F(DefaultFilter, AddsNoCrosstalkToThatOfTheSheet) {
  for (const int views : {2, 3, 4, 8})
    for (const int view : {0, views / 2}) {
      const double own = light(woven(views, view), view + 0.5, views);
      for (const ViewFilter filter : {ViewFilter::Nearest, ViewFilter::Linear, ViewFilter::Gauss})
        EXPECT_GE(own, light(woven(views, view, filter), view + 0.5, views) - 0.01)
            << view << " of " << views << ", " << to_string(filter);
    }
}

TEST_F(DefaultFilter, LetsViewsPassIntoEachOtherWithoutSteps) {
  // The light of a sharp border, seen through the spot, changes by at most 0.4 in one sigma.
  constexpr double kMostChange = 0.4;
  for (const int views : {2, 3, 4, 8}) {
    const WovenFrame frame = woven(views, 0);
    const double step = views * model_.rig().sheet.spot_sigma.value;
    double before = light(frame, 0.5, views);
    for (double place = 0.5 + step; place < 1.5; place += step) {
      const double now = light(frame, place, views);
      EXPECT_LT(std::abs(now - before), kMostChange) << place << " of " << views;
      before = now;
    }
  }
}

TEST_F(DefaultFilter, MixesNeighboursThatTheSheetDoesNotSeparate) {
  optics::LensSheet sheet = model_.rig().sheet;
  const auto chosen = [&](int views) { return view_filter({}, sheet, views); };
  EXPECT_EQ(chosen(5), ViewFilter::Nearest);
  EXPECT_EQ(chosen(6), ViewFilter::Linear) << "as close as subpixels of a colour are to the eye";
  sheet.pitch = Subpixels(24.0);
  EXPECT_EQ(chosen(10), ViewFilter::Nearest);
  EXPECT_EQ(chosen(11), ViewFilter::Linear) << "as close as the spot is wide";
  EXPECT_EQ(view_filter({.filter = ViewFilter::Gauss}, sheet, 2), ViewFilter::Gauss);
}

}  // namespace
}  // namespace lenticule::frames
