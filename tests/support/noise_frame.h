// SPDX-License-Identifier: Apache-2.0
// Makes a picture of independent random samples.
#pragma once

#include <random>

#include "frames/frame.h"

namespace lenticule::test {

[[nodiscard]] inline frames::WovenFrame noise_frame(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  frames::WovenFrame frame({.width = width, .height = height});
  for (uint8_t& byte : frame.bytes()) byte = static_cast<uint8_t>(random() & 255U);
  return frame;
}

}  // namespace lenticule::test
