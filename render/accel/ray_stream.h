// SPDX-License-Identifier: Apache-2.0
// Rays of one tile, and functions that trace them sixteen at a time.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "optics/vec.h"
#include "render/accel/embree.h"

namespace lenticule::render {

inline constexpr size_t kPacket = 16;

/// PathRay is a ray whose light is multiplied by `weight` and added to element `target` of the
/// tile.
struct PathRay {
  static constexpr uint32_t kInactive = ~0U;  ///< `target` of an empty lane of a packet

  Vec3 origin;
  Vec3 direction;  ///< unit
  double weight = 1.0;
  uint32_t target = kInactive;
  int channel = 0;
};

/// Hit is the first intersection of a ray.
struct Hit {
  static constexpr uint32_t kMiss = ~0U;
  static constexpr uint32_t kRefused = ~0U - 1;  ///< the ray was not traced: inactive or non-finite

  uint32_t geometry = kRefused;
  uint32_t primitive = 0;
  float distance = 0.0F;
};

/// ShadowRay is a ray toward a light. Its `light` is added to `target` if the ray is unoccluded.
struct ShadowRay {
  Vec3 origin;
  Vec3 direction;  ///< unit
  double distance = 0.0;
  double light = 0.0;
  uint32_t target = 0;
};

/// Returns true if Embree accepts this ray after rounding to single precision.
[[nodiscard]] bool fit_for_embree(Vec3 origin, Vec3 direction);

/// Intersects rays in packets of consecutive rays. Rays that Embree does not accept are not traced;
/// returns their number.
uint64_t intersect(RTCScene scene, std::span<const PathRay> rays, Coherence coherence,
                   std::span<Hit> hits);

/// Adds the light of every unoccluded ray, in the order of the rays. Returns the number of
/// non-finite rays, which add nothing.
uint64_t add_unshadowed(RTCScene scene, std::span<const ShadowRay> rays, std::span<double> light);

/// RayPacket holds sixteen rays in Embree's layout. `valid` is 0 in inactive lanes.
struct alignas(64) RayPacket {
  RTCRayHit16 rays;
  alignas(64) int valid[kPacket];
};
uint64_t load_packet(std::span<const PathRay> rays, RayPacket& packet);

/// Sets a lane to a ray without an end. The lane's previous hit is kept.
inline void set_lane(RayPacket& packet, size_t lane, Vec3f origin, Vec3f direction) {
  RTCRay16& ray = packet.rays.ray;
  ray.org_x[lane] = origin.x;
  ray.org_y[lane] = origin.y;
  ray.org_z[lane] = origin.z;
  ray.dir_x[lane] = direction.x;
  ray.dir_y[lane] = direction.y;
  ray.dir_z[lane] = direction.z;
  ray.tfar[lane] = std::numeric_limits<float>::infinity();
}

}  // namespace lenticule::render
