// SPDX-License-Identifier: Apache-2.0
// Numbers the frames of a clip that a decoder plays repeatedly.
#pragma once

#include <cstdint>

namespace lenticule::frames {

/// Returns a frame's number in the ring. Numbers keep growing through all loops, in steps of two:
/// the lowest bit marks the clip's first frame. (A ring accepts numbers up to 2^48, which last 70
/// 000 years.)
[[nodiscard]] constexpr uint64_t ring_number(uint64_t position, bool begins_clip) {
  return position << 1 | (begins_clip ? 1 : 0);
}
[[nodiscard]] constexpr uint64_t position_of(uint64_t number) {
  return number >> 1;
}
[[nodiscard]] constexpr bool begins_clip(uint64_t number) {
  return (number & 1) != 0;
}

}  // namespace lenticule::frames
