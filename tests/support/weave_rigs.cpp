// SPDX-License-Identifier: Apache-2.0
#include "tests/support/weave_rigs.h"

#include <random>

namespace lenticule::test {

using frames::PictureFit;
using frames::ViewFilter;
using frames::ViewOrder;
using optics::SubpixelLayout;

frames::WovenFrame weave_noise(int width, int height, uint32_t seed) {
  frames::WovenFrame frame({.width = width, .height = height});
  std::mt19937 random(seed);
  for (uint8_t& byte : frame.bytes()) {
    const auto r = static_cast<uint32_t>(random());
    byte = static_cast<uint8_t>((r & 0x100) != 0 ? ((r & 0x200) != 0 ? 255 : 0) : r);
  }
  return frame;
}

SubpixelLayout two_over_one() {
  return SubpixelLayout::cells(
      2, 1,
      {{{{0.25, 0.25}, {0.75, 0.25}, {0.5, 0.75}}}, {{{0.25, 0.75}, {0.75, 0.75}, {0.5, 0.25}}}});
}

optics::Rig weave_rig(int width, int height, double pitch, double slant, double distance,
                      const SubpixelLayout& layout) {
  optics::Rig rig;
  rig.name = "weave";
  rig.panel = {.width_px = width,
               .height_px = height,
               .pixel_width = Millimetres(0.2),
               .pixel_height = Millimetres(0.2),
               .layout = layout};
  rig.sheet.pitch = Subpixels(pitch);
  rig.sheet.slant = slant;
  rig.sheet.offset = Lenses(0.31);
  rig.sheet.gap = Millimetres(1.6);
  rig.sheet.refraction_shape = 0.44;
  rig.sheet.spot_sigma = Lenses(0.08);
  rig.viewing = {.height = Millimetres(20.0), .distance = Millimetres(distance)};
  return rig;
}

frames::WovenFrame WeaveSetting::noise() const {
  return weave_noise(layout.columns * 7, layout.rows * 5, 17);
}

std::span<const WeaveSetting> weave_settings() {
  static const WeaveSetting settings[] = {
      {{.columns = 3, .rows = 2}, {.filter = ViewFilter::Nearest}},
      {{.columns = 3, .rows = 2, .views = 5}, {.filter = ViewFilter::Linear}},
      {{.columns = 1, .rows = 7}, {.filter = ViewFilter::Nearest, .order = ViewOrder::RightToLeft}},
      {{.columns = 7, .rows = 1, .views = 0, .aspect = 3.0},
       {.filter = ViewFilter::Linear, .fit = PictureFit::Cover}},
      {{.columns = 2, .rows = 4, .views = 8, .aspect = 0.4},
       {.filter = ViewFilter::Gauss, .fit = PictureFit::Contain, .order = ViewOrder::RightToLeft}},
      {{.columns = 1, .rows = 1}, {.filter = ViewFilter::Linear, .fit = PictureFit::Stretch}},
      {{.columns = 8, .rows = 8, .views = 64, .aspect = 4.0},
       {.filter = ViewFilter::Linear, .fit = PictureFit::Contain}},
      {{.columns = 9, .rows = 8, .views = 70}, {.filter = ViewFilter::Linear}},
  };
  return settings;
}

}  // namespace lenticule::test
