// SPDX-License-Identifier: Apache-2.0
// Computes scan-out words from subpixels by the rule itself, without tables or vectors.
#pragma once

#include <cstdint>

#include "display/scanout_depth.h"

namespace lenticule::test {

/// Returns value * 1023 / 255, rounded.
constexpr uint32_t ten_bits_of(uint8_t value) {
  return (uint32_t{value} * 1023 * 2 + 255) / (2 * 255);
}

constexpr uint32_t scanout_word(const uint8_t* rgb, display::ScanoutDepth depth) {
  if (depth == display::ScanoutDepth::Bits10)
    return ten_bits_of(rgb[0]) << 20 | ten_bits_of(rgb[1]) << 10 | ten_bits_of(rgb[2]);
  return uint32_t{rgb[0]} << 16 | uint32_t{rgb[1]} << 8 | uint32_t{rgb[2]};
}

}  // namespace lenticule::test
