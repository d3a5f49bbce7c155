// SPDX-License-Identifier: Apache-2.0
// Tests the whole path: numbered views, woven, seen through the lenses. An eye in the middle of
// view k's zone sees view k, at the panel's edges too.
#include <gtest/gtest.h>

#include <cmath>

#include "frames/weave.h"
#include "optics/eye_simulator.h"

namespace lenticule::frames {
namespace {

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

}  // namespace
}  // namespace lenticule::frames
