// SPDX-License-Identifier: Apache-2.0
#include "calib/phone/phone_observations.h"

#include <algorithm>
#include <cmath>

#include "base/statistics.h"
#include "optics/model.h"

namespace lenticule::calib {
namespace {

constexpr int kGreen = 1;

void add_fringes(const PhotoFindings& photo, const SinglePhotoChart& chart,
                 PhoneObservations& out) {
  const optics::OpticalModel model(photo.rig);
  std::vector<double> weights;
  for (const FringeBlock& block : photo.blocks) weights.push_back(block.weight);
  const double usual = weights.empty() ? 1.0 : upper_median(weights);
  for (const FringeBlock& block : photo.blocks) {
    const auto at = photo.pose->look(block.pixel, chart.start);
    if (!at) continue;
    const double lens = model.lens_coordinate(at->lens_px.x, at->lens_px.y, kGreen);
    const double comb = chart.comb_phase(at->panel_px.x, at->panel_px.y, block.detuning);
    const double per_subpx = 1.0 / chart.centre_pitch_subpx +
                             block.detuning * chart.fringes / (3.0 * chart.start.panel.width_px);
    out.phases.push_back({block.pixel,
                          {.pitch_subpx = 1.0 / per_subpx, .slant = chart.start.sheet.slant},
                          comb - lens + block.phase,
                          std::min(block.weight / usual, 2.0),
                          block.colour_phase});
  }
}

void add_corners(const PhotoFindings& photo, const SinglePhotoChart& chart,
                 PhoneObservations& out) {
  const optics::Panel& panel = chart.start.panel;
  double length = 0.0, picture = 0.0;
  for (const TagSighting& tag : photo.tags) {
    const auto drawn = chart.tag(tag.id)->corners_px();
    const Vec2 middle = (drawn[0] + drawn[2]) * 0.5;
    for (size_t k = 0; k < drawn.size(); ++k) {
      const Vec2 mm{panel.x_mm(drawn[k].x), panel.y_mm(drawn[k].y)};
      out.corners.push_back(
          {tag.corners_px[k], mm, mm - Vec2{panel.x_mm(middle.x), panel.y_mm(middle.y)}});
    }
    length += std::hypot(panel.x_mm(drawn[2].x) - panel.x_mm(drawn[0].x),
                         panel.y_mm(drawn[2].y) - panel.y_mm(drawn[0].y));
    picture += std::hypot(tag.corners_px[2].x - tag.corners_px[0].x,
                          tag.corners_px[2].y - tag.corners_px[0].y);
  }
  out.pixels_per_mm = picture / length;
}

}  // namespace

PhoneObservations phone_observations(const PhotoFindings& photo, const SinglePhotoChart& chart) {
  PhoneObservations out;
  add_fringes(photo, chart, out);
  add_corners(photo, chart, out);
  return out;
}

}  // namespace lenticule::calib
