// SPDX-License-Identifier: Apache-2.0
// Rays of one tile, and their tracing sixteen at a time.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "optics/vec.h"
#include "render/accel/embree.h"

namespace lenticule::render {

inline constexpr size_t kPacket = 16;

/// A ray and what becomes of its light: `weight` times it is added to element `target` of the tile.
struct PathRay {
  static constexpr uint32_t kInactive = ~0U;  ///< as target: an empty lane of a packet

  Vec3 origin;
  Vec3 direction;  ///< unit
  double weight = 1.0;
  uint32_t target = kInactive;
  int channel = 0;
};

/// What a ray met first.
struct Hit {
  static constexpr uint32_t kMiss = ~0U;
  static constexpr uint32_t kRefused = ~0U - 1;  ///< no ray at all: inactive, or not finite

  uint32_t geometry = kRefused;
  uint32_t primitive = 0;
  float distance = 0.0F;
};

/// A ray toward a light; unless something is in its way, `light` is added to `target`.
struct ShadowRay {
  Vec3 origin;
  Vec3 direction;  ///< unit
  double distance = 0.0;
  double light = 0.0;
  uint32_t target = 0;
};

/// Whether Embree may see this ray, rounded to its precision.
[[nodiscard]] bool fit_for_embree(Vec3 origin, Vec3 direction);

/// Packets hold consecutive rays. Rays that are not finite never reach Embree; returns their
/// number.
uint64_t intersect(RTCScene scene, std::span<const PathRay> rays, Coherence coherence,
                   std::span<Hit> hits);

/// Adds the light of every ray whose way is free, in the order of the rays; returns the number of
/// rays that are not finite (they add nothing).
uint64_t add_unshadowed(RTCScene scene, std::span<const ShadowRay> rays, std::span<double> light);

/// Sixteen rays as Embree takes them. `valid` is 0 in lanes that stay out. Returns the number of
/// active rays that were refused.
struct alignas(64) RayPacket {
  RTCRayHit16 rays;
  alignas(64) int valid[kPacket];
};
uint64_t load_packet(std::span<const PathRay> rays, RayPacket& packet);

/// A ray without an end; what it met before is left as it is.
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
