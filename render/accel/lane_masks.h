// SPDX-License-Identifier: Apache-2.0
// Masks of a packet's sixteen lanes: -1 (active) or 0 per lane, as Embree needs, or one bit per
// lane.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#if defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

#include "render/accel/ray_stream.h"

namespace lenticule::render {

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
