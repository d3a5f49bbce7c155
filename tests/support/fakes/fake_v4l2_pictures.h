// SPDX-License-Identifier: Apache-2.0
// States what the pictures of the fake V4L2 decoder look like, for the decoder and for its tests.
#pragma once

#include <cstdint>

namespace lenticule::test {

inline constexpr uint8_t kFakeBlue = 118;  ///< Cb of every picture
inline constexpr uint8_t kFakeRed = 141;   ///< Cr of every picture

/// Returns the luma of all pixels of picture k since the device was opened.
constexpr uint8_t brightness_of_fake_picture(uint64_t k) {
  return static_cast<uint8_t>(40 + k * 11 % 160);
}

}  // namespace lenticule::test
