// SPDX-License-Identifier: Apache-2.0
// Evaluates the shader's arithmetic in single precision from the constants in its text, and
// compares the result with the weaver and with numbered views.
#include "apps/lenticule-tools/offline/mpv_shader.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>

#include "frames/weave.h"
#include "tests/support/error_matchers.h"

namespace lenticule::tools {
namespace {

using test::error_of;

std::map<std::string, float> constants_of(const std::string& shader) {
  std::map<std::string, float> constants;
  std::istringstream lines(shader);
  for (std::string line; std::getline(lines, line);) {
    const std::string start = "const float ";
    if (!line.starts_with(start)) continue;
    const size_t equals = line.find(" = ");
    constants[line.substr(start.size(), equals - start.size())] =
        std::stof(line.substr(equals + 3));
  }
  return constants;
}

/// Returns the view number in float, before rounding down.
float view_of(std::map<std::string, float>& k, int i, int j, int channel) {
  const std::string colour(1, "RGB"[channel]);
  const float x = static_cast<float>(i) + k[colour + "_X"];
  const float y = static_cast<float>(j) + k[colour + "_Y"];
  const float phase = (x - k["WIDTH"] / 2.0F) * k["LENSES_PER_PIXEL"] +
                      (y - k["HEIGHT"] / 2.0F) * k["LENSES_PER_ROW"] + k["OFFSET"];
  return k["VIEWS"] * (0.5F - (phase - std::floor(phase + 0.5F)));
}

optics::Rig rig_of(int width, int height, const optics::SubpixelLayout& layout) {
  optics::Rig rig;
  rig.name = "shader";
  rig.panel = {.width_px = width,
               .height_px = height,
               .pixel_width = Millimetres(0.15),
               .pixel_height = Millimetres(0.15),
               .layout = layout};
  rig.sheet.pitch = Subpixels(7.701);
  rig.sheet.slant = 0.2521;
  rig.sheet.offset = Lenses(0.37);
  rig.sheet.gap = Millimetres(2.0);
  return rig;
}

TEST(MpvShader, ShowsTheSameViewsAsTheWeaver) {
  using optics::SubpixelLayout;
  for (const SubpixelLayout& layout :
       {SubpixelLayout::rgb(), SubpixelLayout::bgr(), SubpixelLayout::vrgb()})
    for (const auto& [width, height] : {std::pair{320, 90}, std::pair{91, 320}}) {
      const optics::Rig rig = rig_of(width, height, layout);
      frames::WovenFrame quilt({.width = 9, .height = 5});
      for (int view = 0; view < 45; ++view)
        for (int c = 0; c < 3; ++c) quilt.row(4 - view / 9)[view % 9 * 3 + c] = uint8_t(5 * view);
      const frames::QuiltLayout tiles{.columns = 9, .rows = 5};
      const frames::WovenFrame woven =
          weave(frames::ViewSet(quilt, tiles), optics::OpticalModel(rig),
                {.filter = frames::ViewFilter::Nearest, .fit = frames::PictureFit::Stretch});
      auto constants = constants_of(mpv_shader(rig, tiles));
      int undecided = 0;
      for (int j = 0; j < height; ++j)
        for (int i = 0; i < width; ++i)
          for (int c = 0; c < 3; ++c) {
            const float view = view_of(constants, i, j, c);
            if (std::abs(view - std::round(view)) < 2e-3F) {
              ++undecided;  // lies on a border between two views
              continue;
            }
            ASSERT_EQ(woven.row(j)[3 * i + c], 5 * static_cast<int>(view)) << i << ", " << j;
          }
      EXPECT_LT(undecided, width * height * 3 / 100);
    }
}

TEST(MpvShader, FoldsTheViewingDistanceIntoThePitch) {
  optics::Rig rig = rig_of(3840, 2160, optics::SubpixelLayout::rgb());
  rig.viewing = {.height = Millimetres(40.0), .distance = Millimetres(600.0)};
  const optics::OpticalModel model(rig);
  auto constants = constants_of(mpv_shader(rig, {.columns = 8, .rows = 6}));
  // The paraxial formula is exact near the panel's centre.
  for (const int i : {1900, 1919, 1920, 1950}) {
    const double place = model.ray(i, 1080, 1).place;
    const double exact = optics::view_number(place, 48);
    EXPECT_NEAR(view_of(constants, i, 1080, 1), exact, 0.02) << i;
  }
}

TEST(MpvShader, RefusesUnsupportedRigsAndLayouts) {
  optics::Rig rig = rig_of(64, 64, optics::SubpixelLayout::rgb());
  EXPECT_EQ(error_of([&] { (void)mpv_shader(rig, {.columns = 0}); }).kind(), ErrorKind::Usage);
  rig.sheet.residual = {.columns = 2, .rows = 2, .lenses = {0, 0, 0, 0.01}};
  EXPECT_EQ(error_of([&] { (void)mpv_shader(rig, {.columns = 8, .rows = 6}); }).kind(),
            ErrorKind::Input);
}

}  // namespace
}  // namespace lenticule::tools
