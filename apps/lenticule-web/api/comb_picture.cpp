// SPDX-License-Identifier: Apache-2.0
#include "apps/lenticule-web/api/comb_picture.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "apps/lenticule-web/api/pictures.h"
#include "frames/charts/charts.h"
#include "optics/eye_simulator.h"

namespace lenticule::web {
namespace {

constexpr int kPictureWidth = 960;
constexpr int kPictureQuality = 85;

/// Returns the rig whose comb is white for the eye: that of a rig is white for an eye straight
/// ahead, at its viewing line.
optics::Rig white_for(optics::Rig rig, const optics::Eye& eye) {
  constexpr int kGreen = 1;
  rig.viewing = {Millimetres(eye.y), Millimetres(eye.z_mm)};
  const optics::OpticalModel model(rig);
  const double x = 0.5 * rig.panel.width_px, y = 0.5 * rig.panel.height_px;
  const optics::Eye ahead{.x = 0.0, .y = eye.y, .z_mm = eye.z_mm};
  rig.sheet.offset =
      rig.sheet.offset + Lenses(model.phase(x, y, kGreen, eye) - model.phase(x, y, kGreen, ahead));
  return rig;
}

/// Adds the channels: through a fine lens an eye sees one subpixel, of one colour, at each place.
optics::RgbPicture without_colour(optics::RgbPicture picture) {
  for (size_t k = 0; k + 2 < picture.pixels.size(); k += 3) {
    const int sum = picture.pixels[k] + picture.pixels[k + 1] + picture.pixels[k + 2];
    std::fill_n(picture.pixels.begin() + static_cast<ptrdiff_t>(k), 3,
                static_cast<uint8_t>(std::min(sum, 255)));
  }
  return picture;
}

}  // namespace

std::string comb_picture(const optics::Rig& woven, const optics::Rig& seen,
                         const optics::Eye& eye) {
  const frames::WovenFrame chart =
      frames::draw_chart({.pattern = frames::ChartPattern::Comb, .rig = white_for(woven, eye)});
  const int width = std::min(kPictureWidth, chart.width());
  const int height = std::max(1, static_cast<int>(int64_t{chart.height()} * width / chart.width()));
  return jpeg_of(without_colour(optics::simulate_eye(optics::OpticalModel(seen),
                                                     {.pixels = chart.bytes().data(),
                                                      .width = chart.width(),
                                                      .height = chart.height(),
                                                      .stride_bytes = chart.geometry().row_bytes()},
                                                     eye, {.width = width, .height = height})),
                 kPictureQuality);
}

}  // namespace lenticule::web
