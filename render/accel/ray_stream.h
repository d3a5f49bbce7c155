// SPDX-License-Identifier: Apache-2.0
// Rays of one tile, and functions that trace them sixteen at a time.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#if defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

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

/// Returns true if Embree accepts this ray after rounding to single precision.
[[nodiscard]] bool fit_for_embree(Vec3 origin, Vec3 direction);

/// RayPacket holds sixteen rays in Embree's layout. `valid` is 0 in inactive lanes.
struct alignas(64) RayPacket {
  RTCRayHit16 rays;
  alignas(64) int valid[kPacket];
};
/// Loads up to sixteen rays. Rays that Embree does not accept are not active; returns their number.
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

/// Traces a packet. `valid` is -1 in active lanes and 0 in inactive lanes, which are not changed. A
/// packet that is not in_one_octant() is traced as incoherent, regardless of `coherence`. `width`
/// is 16, 8 or 4. Thread safety: any thread.
void intersect16(const int* valid, const EmbreeScene& scene, RTCRayHit16& rays, Coherence coherence,
                 int width = widest_packet());
/// Tests a packet for occlusion: sets t_far to -infinity in occluded lanes.
void occluded16(const int* valid, const EmbreeScene& scene, RTCRay16& rays, Coherence coherence,
                int width = widest_packet());

/// Returns true if a packet may be traced as coherent. For coherent packets, Embree first
/// intersects the bounds of all rays, which it computes from the smallest and largest reciprocals
/// of the direction components. If a component has both signs, these reciprocals bound nothing, and
/// Embree can miss the whole packet (`lenticule bench stability`, rows edges and inside). Such
/// packets would not be faster as coherent packets either.
[[nodiscard]] bool in_one_octant(const int* valid, const RTCRay16& rays);

/// Returns Coherent for a packet that is in_one_octant(). Embree's two modes round distances
/// differently, and choose differently among triangles that meet at the ray. A caller that removes
/// lanes by culling chooses the mode before, so that the remaining lanes have the same hits no
/// matter which lanes are culled.
[[nodiscard]] Coherence coherence_of(const int* valid, const RTCRay16& rays);

[[nodiscard]] inline bool any_lane(const int* valid) {
  int all = 0;
  for (size_t r = 0; r < kPacket; ++r) all |= valid[r];
  return all != 0;
}

/// Returns a bit mask of the valid lanes.
[[nodiscard]] inline uint32_t lane_bits(const int* valid) {
#if defined(__SSE2__)
  const auto four = [&](size_t first) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(valid + first));
  };
  const __m128i low = _mm_packs_epi32(four(0), four(4)), high = _mm_packs_epi32(four(8), four(12));
  return static_cast<uint32_t>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
#elif defined(__aarch64__)
  static constexpr uint16_t kBit[8] = {1, 2, 4, 8, 16, 32, 64, 128};
  const auto eight = [&](size_t first) {
    const int16x8_t lanes =
        vcombine_s16(vmovn_s32(vld1q_s32(valid + first)), vmovn_s32(vld1q_s32(valid + first + 4)));
    return uint32_t{vaddvq_u16(vandq_u16(vreinterpretq_u16_s16(lanes), vld1q_u16(kBit)))};
  };
  return eight(0) | eight(8) << 8;
#else
  uint32_t bits = 0;
  for (uint32_t r = 0; r < kPacket; ++r) bits |= static_cast<uint32_t>(valid[r] & 1) << r;
  return bits;
#endif
}

/// Returns a bit mask of the lanes whose number has the sign bit set.
[[nodiscard]] inline uint32_t sign_bits(const float* lanes) {
#if defined(__SSE2__)
  const auto four = [&](size_t first) {
    return static_cast<uint32_t>(_mm_movemask_ps(_mm_loadu_ps(lanes + first)));
  };
  return four(0) | four(4) << 4 | four(8) << 8 | four(12) << 12;
#else
  int negative[kPacket];
  for (size_t r = 0; r < kPacket; ++r) negative[r] = std::bit_cast<int32_t>(lanes[r]) >> 31;
  return lane_bits(negative);
#endif
}

/// Returns a bit mask of the lanes whose number is greater than `limit`.
[[nodiscard]] inline uint32_t lanes_above(const float* lanes, float limit) {
#if defined(__SSE2__)
  const auto four = [&](size_t first) {
    return static_cast<uint32_t>(
        _mm_movemask_ps(_mm_cmpgt_ps(_mm_loadu_ps(lanes + first), _mm_set1_ps(limit))));
  };
  return four(0) | four(4) << 4 | four(8) << 8 | four(12) << 12;
#else
  int above[kPacket];
  for (size_t r = 0; r < kPacket; ++r) above[r] = lanes[r] > limit ? -1 : 0;
  return lane_bits(above);
#endif
}

/// Bit of each lane. A loop over lanes that tests `(lanes & kLaneBit[r]) != 0` can be vectorized.
inline constexpr uint32_t kLaneBit[kPacket] = {
    1U << 0, 1U << 1, 1U << 2,  1U << 3,  1U << 4,  1U << 5,  1U << 6,  1U << 7,
    1U << 8, 1U << 9, 1U << 10, 1U << 11, 1U << 12, 1U << 13, 1U << 14, 1U << 15};

inline constexpr uint32_t kAllLanes = (1U << kPacket) - 1;

/// Sets the lanes in `lanes` to invalid.
inline void take_lanes(uint32_t lanes, int* valid) {
  if (lanes == 0) return;
  for (size_t r = 0; r < kPacket; ++r) valid[r] = (lanes & kLaneBit[r]) != 0 ? 0 : valid[r];
}

[[nodiscard]] inline uint64_t count_lanes(const int* valid) {
  int sum = 0;
  for (size_t r = 0; r < kPacket; ++r) sum += valid[r];
  return static_cast<uint64_t>(-sum);
}

}  // namespace lenticule::render
