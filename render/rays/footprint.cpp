// SPDX-License-Identifier: Apache-2.0
#include "render/rays/footprint.h"

#include <cmath>

namespace lenticule::render {
namespace {

/// Returns the radical inverse of i in base 2: 0, 1/2, 1/4, 3/4, ...
double radical_inverse(unsigned i) {
  double value = 0.0;
  for (double digit = 0.5; i != 0; i >>= 1, digit *= 0.5)
    if (i & 1U) value += digit;
  return value;
}

bool subpixels_are_stacked(const optics::SubpixelLayout& layout) {
  return layout.name() == "vrgb" || layout.name() == "vbgr";
}

}  // namespace

std::vector<SubpixelPlace> footprint_samples(int count) {
  if (count <= 1) return {{0.0, 0.0}};
  std::vector<SubpixelPlace> places;
  double mean_y = 0.0;
  for (int i = 0; i < count; ++i) {
    places.push_back({(i + 0.5) / count - 0.5, radical_inverse(static_cast<unsigned>(i))});
    mean_y += places.back().y / count;
  }
  // The mean is subtracted, so that the number of samples does not shift the picture.
  for (SubpixelPlace& place : places) place.y -= mean_y;
  return places;
}

Footprint::Footprint(const optics::OpticalModel& model, SubpixelPlace place)
    : centred_(place.x == 0.0 && place.y == 0.0 && place.lens == 0.0),
      gap_mm_(model.rig().sheet.gap.value),
      shape_(1.0 - model.rig().sheet.refraction_shape),
      across_lens_mm_(place.lens * model.pitch_mm()) {
  const optics::Rig& rig = model.rig();
  const double pixel_width = rig.panel.pixel_width.value;
  const double pixel_height = rig.panel.pixel_height.value;
  const bool stacked = subpixels_are_stacked(rig.panel.layout);
  const double dx = place.x * pixel_width * (stacked ? 1.0 : 1.0 / 3.0);
  const double rows_down = place.y * (stacked ? 1.0 / 3.0 : 1.0);
  // The row of the lens point follows from the row of the panel point by the ratio of their
  // distances to the eye.
  const double distance = rig.viewing.distance.value;
  const double lens_rows_down =
      std::isinf(distance) ? rows_down : rows_down * distance / (distance + gap_mm_);
  lens_dy_mm_ = -lens_rows_down * pixel_height;
  lens_dx_mm_ = -lens_rows_down * rig.sheet.slant * pixel_width;
  shift_dx_mm_ = lens_dx_mm_ - dx;
  tan_per_mm_ = std::isinf(distance) ? 0.0 : -1.0 / distance;
}

PanelRay Footprint::moved(const PanelRay& centre) const {
  PanelRay ray = through_apex(centre);
  ray.x_mm += across_lens_mm_;
  ray.tan_x += across_lens_mm_ * tan_per_mm_;
  return ray;
}

PanelRay Footprint::through_apex(const PanelRay& centre) const {
  PanelRay ray;
  ray.x_mm = centre.x_mm + lens_dx_mm_;
  ray.y_mm = centre.y_mm + lens_dy_mm_;
  ray.tan_y = centre.tan_y + lens_dy_mm_ * tan_per_mm_;
  ray.tan_x = centre.tan_x;
  if (!(gap_mm_ > 0.0)) return ray;
  // Applies the sheet's refraction law to the centre ray to get Delta_x / g, adds the displacement,
  // and solves the law for the new tangent.
  const double squares = centre.tan_x * centre.tan_x + centre.tan_y * centre.tan_y;
  const double shift = centre.tan_x / std::sqrt(1.0 + shape_ * squares) + shift_dx_mm_ / gap_mm_;
  const double denominator = 1.0 - shape_ * shift * shift;
  if (denominator > 0.0)
    ray.tan_x = shift * std::sqrt((1.0 + shape_ * ray.tan_y * ray.tan_y) / denominator);
  return ray;
}

Interval operator*(Interval a, Interval b) {
  Interval product;
  for (const double factor : {a.low, a.high}) {
    product.extend(factor * b.low);
    product.extend(factor * b.high);
  }
  return product;
}

void Beam::extend(const Beam& other) {
  x_mm.extend(other.x_mm);
  tan_x.extend(other.tan_x);
  y_mm.extend(other.y_mm);
  tan_y.extend(other.tan_y);
  start_mm = other.start_mm;
}

}  // namespace lenticule::render
