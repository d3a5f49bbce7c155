// SPDX-License-Identifier: Apache-2.0
#include "render/accel/ray_stream.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/accel/embree_packets.h"

namespace lenticule::render {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Fraction of the distance to a light within which an occluder counts as the light itself.
constexpr double kLightClearance = 1.0 / (1 << 18);

/// Fills lane i. Returns false, and loads a harmless ray, if Embree must not get this one.
bool load_lane(RTCRay16& rays, size_t i, Vec3 origin, Vec3 direction, float far) {
  const Vec3f o(origin);
  const Vec3f d(direction);
  const bool accepted = fit_for_embree(origin, direction) && far >= 0.0F;
  rays.org_x[i] = accepted ? o.x : 0.0F;
  rays.org_y[i] = accepted ? o.y : 0.0F;
  rays.org_z[i] = accepted ? o.z : 0.0F;
  rays.dir_x[i] = accepted ? d.x : 0.0F;
  rays.dir_y[i] = accepted ? d.y : 0.0F;
  rays.dir_z[i] = accepted ? d.z : 1.0F;
  rays.tnear[i] = 0.0F;
  rays.tfar[i] = accepted ? far : 0.0F;
  rays.time[i] = 0.0F;
  rays.mask[i] = ~0U;
  rays.id[i] = 0;
  rays.flags[i] = 0;
  return accepted;
}

void fill_empty_lanes(RTCRay16& rays, int* valid, size_t from) {
  for (size_t i = from; i < kPacket; ++i) {
    load_lane(rays, i, {}, {0, 0, 1}, 0.0F);
    valid[i] = 0;
  }
}

}  // namespace

bool fit_for_embree(Vec3 origin, Vec3 direction) {
  const Vec3f o(origin);
  const Vec3f d(direction);
  return embree_accepts(o.x, o.y, o.z) && embree_accepts(d.x, d.y, d.z) && !(d == Vec3f{});
}

uint64_t load_packet(std::span<const PathRay> rays, RayPacket& packet) {
  uint64_t refused = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    const bool active = rays[i].target != PathRay::kInactive;
    const bool accepted =
        load_lane(packet.rays.ray, i, rays[i].origin, rays[i].direction, kInfinity);
    packet.valid[i] = active && accepted ? -1 : 0;
    if (active && !accepted) ++refused;
  }
  fill_empty_lanes(packet.rays.ray, packet.valid, rays.size());
  std::fill_n(packet.rays.hit.geomID, kPacket, RTC_INVALID_GEOMETRY_ID);
  std::fill_n(packet.rays.hit.instID[0], kPacket, RTC_INVALID_GEOMETRY_ID);
  return refused;
}

uint64_t intersect(RTCScene scene, std::span<const PathRay> rays, Coherence coherence,
                   std::span<Hit> hits) {
  static_assert(Hit::kMiss == RTC_INVALID_GEOMETRY_ID);
  uint64_t refused = 0;
  RayPacket packet;
  for (size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const auto lanes = rays.subspan(begin, std::min(kPacket, rays.size() - begin));
    refused += load_packet(lanes, packet);
    intersect16(packet.valid, scene, packet.rays, coherence);
    for (size_t i = 0; i < lanes.size(); ++i) {
      const bool traced = packet.valid[i] != 0;
      hits[begin + i] = {.geometry = traced ? packet.rays.hit.geomID[i] : Hit::kRefused,
                         .primitive = packet.rays.hit.primID[i],
                         .distance = packet.rays.ray.tfar[i]};
    }
  }
  return refused;
}

uint64_t add_unshadowed(RTCScene scene, std::span<const ShadowRay> rays, std::span<double> light) {
  uint64_t refused = 0;
  RTCRay16 packet;
  alignas(64) int valid[kPacket];
  for (size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const auto lanes = rays.subspan(begin, std::min(kPacket, rays.size() - begin));
    for (size_t i = 0; i < lanes.size(); ++i) {
      const auto far = static_cast<float>(lanes[i].distance * (1.0 - kLightClearance));
      const bool accepted = load_lane(packet, i, lanes[i].origin, lanes[i].direction, far);
      valid[i] = accepted ? -1 : 0;
      if (!accepted) ++refused;
    }
    fill_empty_lanes(packet, valid, lanes.size());
    occluded16(valid, scene, packet, Coherence::Coherent);
    for (size_t i = 0; i < lanes.size(); ++i)
      if (valid[i] != 0 && packet.tfar[i] >= 0.0F) light[lanes[i].target] += lanes[i].light;
  }
  return refused;
}

}  // namespace lenticule::render
