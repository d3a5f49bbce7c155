// SPDX-License-Identifier: Apache-2.0
#include "render/rays/packet_backdrop.h"

#include <bit>

#include "render/scene/texture.h"

namespace lenticule::render {

void light_beyond_packet(const Backdrop& backdrop, const RayPacket& packet, uint32_t lanes,
                         std::span<const int32_t, kPacket> channel,
                         std::array<float, kPacket>& out) {
  static_assert(GroundShadow::kRays == kPacket);
  const RTCRay16& ray = packet.rays.ray;
  if (backdrop.ground_shadow) {
    std::array<double, kPacket> left;
    backdrop.ground_shadow->light_left({.origin_x = ray.org_x,
                                        .origin_y = ray.org_y,
                                        .origin_z = ray.org_z,
                                        .direction_x = ray.dir_x,
                                        .direction_y = ray.dir_y,
                                        .direction_z = ray.dir_z},
                                       left);
    for (size_t r = 0; r < kPacket; ++r)
      out[r] = static_cast<float>(component(backdrop.colour, channel[r]) * left[r]);
    return;
  }
  for (; lanes != 0; lanes &= lanes - 1) {
    const auto r = static_cast<size_t>(std::countr_zero(lanes));
    const Vec3 direction{double{ray.dir_x[r]}, double{ray.dir_y[r]}, double{ray.dir_z[r]}};
    out[r] = static_cast<float>(backdrop_light(backdrop, normalized(direction), channel[r]));
  }
}

}  // namespace lenticule::render
