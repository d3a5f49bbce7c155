// SPDX-License-Identifier: Apache-2.0
#include "render/integrator/depth_notes.h"

#include <limits>

namespace lenticule::render {

DepthNotes::DepthNotes(const Scene& scene) {
  const Affine panel_from_scene = scene.scene_from_panel.inverse();
  z_of_scene_ = Vec3f(
      Vec3{panel_from_scene.column_x.z, panel_from_scene.column_y.z, panel_from_scene.column_z.z});
  z_at_origin_ = static_cast<float>(panel_from_scene.origin.z);
}

void DepthNotes::start(const Tile& tile) {
  columns_ = static_cast<size_t>(tile.columns);
  z_mm_.assign(columns_ * TilePlan::kRows, -std::numeric_limits<float>::infinity());
}

void DepthNotes::note(int column, const RayPacket& packet) {
  const RTCRay16& ray = packet.rays.ray;
  for (size_t r = 0; r < kPacket; ++r) {
    if (packet.valid[r] == 0 || packet.rays.hit.geomID[r] == RTC_INVALID_GEOMETRY_ID) continue;
    const float t = ray.tfar[r];
    z_mm_[r * columns_ + static_cast<size_t>(column)] =
        z_at_origin_ + z_of_scene_.x * (ray.org_x[r] + t * ray.dir_x[r]) +
        z_of_scene_.y * (ray.org_y[r] + t * ray.dir_y[r]) +
        z_of_scene_.z * (ray.org_z[r] + t * ray.dir_z[r]);
  }
}

}  // namespace lenticule::render
