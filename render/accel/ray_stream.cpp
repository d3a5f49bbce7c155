// SPDX-License-Identifier: Apache-2.0
#include "render/accel/ray_stream.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>

namespace lenticule::render {

bool fit_for_embree(Vec3 origin, Vec3 direction) {
  const Vec3f o(origin);
  const Vec3f d(direction);
  return embree_accepts(o.x, o.y, o.z) && embree_accepts(d.x, d.y, d.z) && !(d == Vec3f{});
}

uint64_t load_packet(std::span<const PathRay> rays, RayPacket& packet) {
  RTCRay16& out = packet.rays.ray;
  uint64_t refused = 0;
  for (size_t i = 0; i < kPacket; ++i) {
    const bool active = i < rays.size() && rays[i].target != PathRay::kInactive;
    const bool accepted = i < rays.size() && fit_for_embree(rays[i].origin, rays[i].direction);
    // Other rays must not reach Embree: their lanes hold a harmless one.
    set_lane(packet, i, accepted ? Vec3f(rays[i].origin) : Vec3f{},
             accepted ? Vec3f(rays[i].direction) : Vec3f{0, 0, 1});
    if (!accepted) out.tfar[i] = 0.0F;
    out.tnear[i] = 0.0F;
    out.time[i] = 0.0F;
    out.mask[i] = ~0U;
    out.id[i] = 0;
    out.flags[i] = 0;
    packet.valid[i] = active && accepted ? -1 : 0;
    if (active && !accepted) ++refused;
  }
  std::fill_n(packet.rays.hit.geomID, kPacket, RTC_INVALID_GEOMETRY_ID);
  std::fill_n(packet.rays.hit.instID[0], kPacket, RTC_INVALID_GEOMETRY_ID);
  return refused;
}

namespace {

/// Returns true if Embree treats one direction component of all lanes in `valid` as positive, or of
/// all as negative. Embree replaces components of either sign that are nearer to zero than 1e-18 by
/// +1e-18.
bool on_one_side(uint32_t valid, const float* components) {
  // Nearly always all sign bits are equal, and this runs for every packet.
  const uint32_t negative = sign_bits(components) & valid;
  if (negative == 0) return true;
  constexpr float kClear = 1e-17F;
  if (negative == valid && (lanes_above(components, -kClear) & valid) == 0) return true;
  for (uint32_t left = negative; left != 0; left &= left - 1)
    if (!(components[std::countr_zero(left)] >= 0.0F)) return false;  // -0 is not below
  return true;
}

}  // namespace

bool in_one_octant(const int* valid, const RTCRay16& rays) {
  const uint32_t lanes = lane_bits(valid);
  return on_one_side(lanes, rays.dir_x) && on_one_side(lanes, rays.dir_y) &&
         on_one_side(lanes, rays.dir_z);
}

Coherence coherence_of(const int* valid, const RTCRay16& rays) {
  return in_one_octant(valid, rays) ? Coherence::Coherent : Coherence::Incoherent;
}

namespace {

/// Rays of one octant may lie in several in the frame of an instance.
Coherence checked(Coherence wanted, const int* valid, const RTCRay16& rays,
                  const EmbreeScene& scene) {
  if (scene.has_instances()) return Coherence::Incoherent;
  return wanted == Coherence::Coherent ? coherence_of(valid, rays) : wanted;
}

/// Traces sixteen rays in parts of `kLanes`. Embree's packets are arrays of four-byte numbers with
/// one element per lane.
template <class Part, int kLanes, class Function, class Whole>
void query_parts(Function* function, const EmbreeScene& scene, Whole& rays, Coherence coherence,
                 const int* valid) {
  static_assert(sizeof(Whole) * kLanes == sizeof(Part) * 16 && sizeof(Part) % (4 * kLanes) == 0);
  constexpr size_t kFields = sizeof(Part) / (4 * kLanes);
  auto* whole = reinterpret_cast<unsigned char*>(&rays);
  for (int first = 0; first < 16; first += kLanes) {
    alignas(64) int part_valid[kLanes];
    int any = 0;
    for (int r = 0; r < kLanes; ++r) any |= part_valid[r] = valid[first + r];
    if (any == 0) continue;
    Part part;
    auto* lanes = reinterpret_cast<unsigned char*>(&part);
    for (size_t f = 0; f < kFields; ++f)
      std::memcpy(lanes + f * 4 * kLanes, whole + f * 64 + 4 * first, 4 * kLanes);
    query(function, scene, part, coherence, part_valid);
    for (size_t f = 0; f < kFields; ++f)
      std::memcpy(whole + f * 64 + 4 * first, lanes + f * 4 * kLanes, 4 * kLanes);
  }
}

}  // namespace

void intersect16(const int* valid, const EmbreeScene& scene, RTCRayHit16& rays, Coherence coherence,
                 int width) {
  coherence = checked(coherence, valid, rays.ray, scene);
  if (width == 16)
    query(rtcIntersect16, scene, rays, coherence, valid);
  else if (width == 8)
    query_parts<RTCRayHit8, 8>(rtcIntersect8, scene, rays, coherence, valid);
  else
    query_parts<RTCRayHit4, 4>(rtcIntersect4, scene, rays, coherence, valid);
  RTCRay16& ray = rays.ray;
  // Neighbouring rays often hit the same triangle.
  uint32_t geometry = RTC_INVALID_GEOMETRY_ID, primitive = 0;
  HitPlane plane;
  for (size_t r = 0; r < kPacket; ++r) {
    if (valid[r] == 0 || rays.hit.geomID[r] == RTC_INVALID_GEOMETRY_ID) continue;
    scene.name_instance(rays.hit.geomID[r], rays.hit.instID[0][r]);
    if (rays.hit.geomID[r] != geometry || rays.hit.primID[r] != primitive)
      plane = scene.plane(geometry = rays.hit.geomID[r], primitive = rays.hit.primID[r]);
    ray.tfar[r] = plane.distance({ray.org_x[r], ray.org_y[r], ray.org_z[r]},
                                 {ray.dir_x[r], ray.dir_y[r], ray.dir_z[r]}, ray.tfar[r]);
  }
}

void occluded16(const int* valid, const EmbreeScene& scene, RTCRay16& rays, Coherence coherence,
                int width) {
  coherence = checked(coherence, valid, rays, scene);
  if (width == 16) return query(rtcOccluded16, scene, rays, coherence, valid);
  if (width == 8) return query_parts<RTCRay8, 8>(rtcOccluded8, scene, rays, coherence, valid);
  query_parts<RTCRay4, 4>(rtcOccluded4, scene, rays, coherence, valid);
}

}  // namespace lenticule::render
