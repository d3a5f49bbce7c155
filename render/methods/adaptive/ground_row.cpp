// SPDX-License-Identifier: Apache-2.0
#include "render/methods/adaptive/ground_row.h"

#include "render/row_sweep/row_sweep.h"
#include "render/scene/texture.h"

namespace lenticule::render {

GroundRow::GroundRow(const Scene& scene, const RowPlanes& planes)
    : scene_(scene), planes_(planes), corners_mm_(scene.backdrop.ground_shadow->corners()) {
  const Affine panel_from_scene = scene.scene_from_panel.inverse();
  for (Vec3& corner : corners_mm_) corner = panel_from_scene.point(corner);
}

void GroundRow::start(const RowPlane& plane, const Interval& eyes) {
  set_range(plane, eyes);
  if (range_mm_.empty()) return;
  row_.emplace(*scene_.backdrop.ground_shadow, scene_.scene_from_panel, plane.lens_y_mm,
               plane.tan_y);
}

/// The plane cuts the ground in a line, which the eyes see between its ends.
void GroundRow::set_range(const RowPlane& plane, const Interval& eyes) {
  const auto above_plane = [&](Vec3 p) { return p.y - plane.lens_y_mm - plane.tan_y * p.z; };
  range_mm_ = {};
  for (size_t n = 0; n < corners_mm_.size(); ++n) {
    const Vec3 a = corners_mm_[n], b = corners_mm_[(n + 1) % corners_mm_.size()];
    const double from = above_plane(a), to = above_plane(b);
    if ((from > 0.0) == (to > 0.0)) continue;
    const Vec3 at = a + (b - a) * (from / (from - to));
    if (!extend_by_view({at.x, at.z}, planes_.inverse_z(), eyes, range_mm_)) {
      range_mm_ = kEverywhere;
      return;
    }
  }
}

double GroundRow::light(double x_mm, double tan_x, int channel) const {
  return component(scene_.backdrop.colour, channel) * row_->light_left(x_mm, tan_x);
}

}  // namespace lenticule::render
