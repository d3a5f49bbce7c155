// SPDX-License-Identifier: Apache-2.0
// How a decoder numbers the frames of a clip that it plays again and again.
#pragma once

#include <cstdint>

namespace lenticule::video {

/// Ring numbers grow through all loops, and say where each begins.
inline constexpr int kFrameBits = 40;

[[nodiscard]] constexpr uint64_t ring_number(uint64_t loop, uint64_t frame) {
  return loop << kFrameBits | (frame & ((uint64_t{1} << kFrameBits) - 1));
}
[[nodiscard]] constexpr uint64_t loop_of(uint64_t number) {
  return number >> kFrameBits;
}
[[nodiscard]] constexpr uint64_t frame_of(uint64_t number) {
  return number & ((uint64_t{1} << kFrameBits) - 1);
}

}  // namespace lenticule::video
