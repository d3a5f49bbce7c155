// SPDX-License-Identifier: Apache-2.0
#include "frames/decoded_view.h"

#include <algorithm>
#include <cmath>

#include "optics/eye_simulator.h"

namespace lenticule::frames {

optics::Eye eye_of_view(const optics::OpticalModel& model, int view, int views) {
  optics::Eye eye = model.design_eye();
  const double gap_mm = model.rig().sheet.gap.value;
  if (gap_mm == 0.0) return eye;
  const double lobes_from_middle = (view + 0.5) / views - 0.5;
  // An eye at infinity is a direction, so the lobe's width is a difference of tangents.
  eye.x += lobes_from_middle *
           (std::isinf(eye.z_mm) ? model.pitch_mm() / gap_mm : model.lobe_width_mm(eye.z_mm));
  return eye;
}

FrameGeometry decoded_geometry(const optics::Rig& rig) {
  const optics::Panel& panel = rig.panel;
  const double lenses = 3.0 * panel.width_px / rig.sheet.pitch.value;
  const double width_mm = panel.width_px * panel.pixel_width.value;
  const double height_mm = panel.height_px * panel.pixel_height.value;
  const auto side = [](double pixels) {
    return std::max(1, static_cast<int>(std::lround(pixels)));
  };
  return {.width = side(lenses), .height = side(lenses * height_mm / width_mm)};
}

WovenFrame decode_view(const FrameView& woven, const optics::OpticalModel& model, int view,
                       int views) {
  const FrameGeometry geometry = decoded_geometry(model.rig());
  const optics::RgbPicture seen = optics::simulate_eye(
      model,
      {.pixels = woven.bytes.data(),
       .width = woven.geometry.width,
       .height = woven.geometry.height,
       .stride_bytes = woven.geometry.row_bytes()},
      eye_of_view(model, view, views), {.width = geometry.width, .height = geometry.height});
  WovenFrame picture(geometry);
  std::copy(seen.pixels.begin(), seen.pixels.end(), picture.bytes().begin());
  return picture;
}

}  // namespace lenticule::frames
