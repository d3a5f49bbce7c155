// SPDX-License-Identifier: Apache-2.0
// Rays from points of the glass into the scene, as Embree takes them.
#pragma once

#include "render/committed_scene.h"
#include "render/ray_stream.h"

namespace lenticule::render {

/// Millimetres of the panel frame; the ray leaves the glass toward the viewer in direction
/// (tan_x, tan_y, 1), and is followed the other way.
struct GlassRay {
  double x_mm = 0.0, y_mm = 0.0;
  double tan_x = 0.0, tan_y = 0.0;
};

/// Lane `lane` from z = start_mm on; its parameter counts millimetres of z. Nothing is met yet.
inline void set_glass_ray(const Scene::Impl& scene, double start_mm, const GlassRay& from,
                          RayPacket& packet, size_t lane) {
  const Affine& to_scene = scene.scene_from_panel;
  const Vec3 origin{from.x_mm + start_mm * from.tan_x, from.y_mm + start_mm * from.tan_y, start_mm};
  set_lane(packet, lane, Vec3f(to_scene.point(origin)),
           Vec3f(to_scene.vector({-from.tan_x, -from.tan_y, -1.0})));
  packet.rays.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
}

}  // namespace lenticule::render
