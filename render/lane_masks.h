// SPDX-License-Identifier: Apache-2.0
// Which of a packet's sixteen lanes have a ray: -1 or 0 each, as Embree wants them, or a bit each.
#pragma once

#include <cstddef>
#include <cstdint>

#include "render/ray_stream.h"

namespace lenticule::render {

[[nodiscard]] inline bool any_lane(const int* valid) {
  int all = 0;
  for (size_t r = 0; r < kPacket; ++r) all |= valid[r];
  return all != 0;
}

/// A bit for each valid lane.
[[nodiscard]] inline uint32_t lane_bits(const int* valid) {
  uint32_t bits = 0;
  for (uint32_t r = 0; r < kPacket; ++r) bits |= static_cast<uint32_t>(valid[r] & 1) << r;
  return bits;
}

/// Makes lanes invalid.
inline void take_lanes(uint32_t lanes, int* valid) {
  if (lanes == 0) return;
  for (uint32_t r = 0; r < kPacket; ++r) valid[r] &= static_cast<int>(lanes >> r & 1) - 1;
}

[[nodiscard]] inline uint64_t count_lanes(const int* valid) {
  int sum = 0;
  for (size_t r = 0; r < kPacket; ++r) sum += valid[r];
  return static_cast<uint64_t>(-sum);
}

}  // namespace lenticule::render
