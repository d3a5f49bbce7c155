// SPDX-License-Identifier: Apache-2.0
// Computes a frame under an overlay from the definition, in double precision and without tables.
#pragma once

#include <cmath>

#include "frames/frame.h"

namespace lenticule::test {

/// A picture with straight alpha, which may differ for each pixel.
struct RgbaPicture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba{};
};

inline double light_of_code(uint8_t code) {
  const double encoded = code / 255.0;
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

/// Returns the code of (1 - alpha) parts of the light of `below` and alpha parts of that of `over`.
inline uint8_t blended_code(uint8_t below, uint8_t over, uint8_t alpha) {
  if (alpha == 0) return below;
  if (alpha == 255) return over;
  const double part = alpha / 255.0;
  const double light = part * light_of_code(over) + (1.0 - part) * light_of_code(below);
  const double encoded =
      light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::lround(255.0 * encoded));
}

/// Draws the picture over the frame, with its first pixel at (left, top).
inline void draw_over(frames::WovenFrame& frame, const RgbaPicture& picture, int left, int top) {
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < picture.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const uint8_t* const pixel = &picture.rgba[4 * static_cast<size_t>(y * picture.width + x)];
        uint8_t& at = frame.row(top + y)[3 * (left + x) + c];
        at = blended_code(at, pixel[c], pixel[3]);
      }
}

}  // namespace lenticule::test
