// SPDX-License-Identifier: Apache-2.0
#include "tests/support/oracles/beam_oracle.h"

#include <cmath>

namespace lenticule::test {
namespace {

/// Returns Ex of the eye on the viewing line that sees a panel point at the apex line of `lens`.
double eye_of(const optics::OpticalModel& model, Vec2 point_px, int channel, int64_t lens,
              double near_ex) {
  optics::Eye eye = model.design_eye();
  const auto phase_at = [&](double ex) {
    eye.x = ex;
    return model.phase(point_px.x, point_px.y, channel, eye) - static_cast<double>(lens);
  };
  const double step = std::isinf(eye.z_mm) ? 0.3 : 0.3 * eye.z_mm;
  double low = near_ex - step, high = near_ex + step;
  const bool rises = phase_at(high) > phase_at(low);
  for (int n = 0; n < 100; ++n) {
    const double middle = (low + high) / 2;
    ((phase_at(middle) > 0.0) == rises ? high : low) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

ReferenceLine beam_line(const optics::OpticalModel& model, int i, int j, int channel,
                        const render::SubpixelPlace& place) {
  const optics::Rig& rig = model.rig();
  const optics::SubpixelRay middle = model.ray(i, j, channel);
  const optics::SubpixelOffset centre = rig.panel.layout.offset(i, j, channel);
  const Vec2 px{i + centre.x_px + place.x / 3.0, j + centre.y_px + place.y};
  const optics::Eye line = model.design_eye();
  const bool parallel = std::isinf(line.z_mm);
  const double near_ex = parallel ? middle.tan_x : middle.lens_x_mm + middle.tan_x * line.z_mm;
  const optics::Eye eye{eye_of(model, px, channel, middle.lens, near_ex), line.y, line.z_mm};
  const Vec2 mm{(px.x - rig.panel.width_px / 2.0) * rig.panel.pixel_width.value,
                (rig.panel.height_px / 2.0 - px.y) * rig.panel.pixel_height.value};
  const double gap = rig.sheet.gap.value;
  const double y =
      parallel ? mm.y + gap * eye.y : (mm.y * eye.z_mm + gap * eye.y) / (eye.z_mm + gap);
  const double apex = model.lens_point_mm(mm, eye).x;
  const double x = apex + place.lens * model.pitch_mm();
  // The rays to an eye at infinity are parallel across the whole lens.
  if (parallel) return {.x_mm = x, .y_mm = y, .tan_x = eye.x, .tan_y = eye.y};
  return {.x_mm = x, .y_mm = y, .tan_x = (eye.x - x) / eye.z_mm, .tan_y = (eye.y - y) / eye.z_mm};
}

double beam_mean(const render::SceneDescription& scene, const render::Stage& stage,
                 const optics::OpticalModel& model, int i, int j, int channel,
                 const std::vector<render::SubpixelPlace>& places, double start_mm) {
  double sum = 0.0;
  for (const render::SubpixelPlace& place : places)
    sum += reference_light(scene, stage, beam_line(model, i, j, channel, place), start_mm, channel);
  return reference_code(sum / static_cast<double>(places.size()), scene.colour_managed);
}

std::vector<render::SubpixelPlace> beam_grid(int across, int down, int lens) {
  std::vector<render::SubpixelPlace> places;
  for (int x = 0; x < across; ++x)
    for (int y = 0; y < down; ++y)
      for (int l = 0; l < lens; ++l)
        places.push_back({.x = (x + 0.5) / across - 0.5,
                          .y = (y + 0.5) / down - 0.5,
                          .lens = (l + 0.5) / lens - 0.5});
  return places;
}

}  // namespace lenticule::test
