// SPDX-License-Identifier: Apache-2.0
// How a decoder numbers the frames of a clip that it plays again and again.
#pragma once

#include <cstdint>

namespace lenticule::frames {

/// Ring numbers go on growing through all loops, by steps of two: the lowest bit says that the
/// frame is the clip's first. (A ring takes 2^48: what is shown in 70 000 years.)
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
