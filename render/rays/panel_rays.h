// SPDX-License-Identifier: Apache-2.0
// Rays from points of the panel into the scene, in Embree's packet format.
#pragma once

#include "render/accel/ray_stream.h"
#include "render/rays/footprint.h"
#include "render/scene/scene.h"

namespace lenticule::render {

/// Sets lane `lane` to the line `from`, starting at z = start_mm and going away from the viewer.
/// The ray parameter counts millimetres of z. The hit is reset to none.
inline void set_panel_ray(const Scene& scene, double start_mm, const PanelRay& from,
                          RayPacket& packet, size_t lane) {
  const Affine& to_scene = scene.scene_from_panel;
  const Vec3 origin{from.x_mm + start_mm * from.tan_x, from.y_mm + start_mm * from.tan_y, start_mm};
  set_lane(packet, lane, Vec3f(to_scene.point(origin)),
           Vec3f(to_scene.vector({-from.tan_x, -from.tan_y, -1.0})));
  packet.rays.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
}

}  // namespace lenticule::render
