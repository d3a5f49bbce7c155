// SPDX-License-Identifier: Apache-2.0
// Converts between 8-bit code values and linear light in [0, 1] with the sRGB transfer curve.
#pragma once

#include <array>
#include <cstdint>

namespace lenticule::frames {

/// Returns the linear light of an encoded value; both in [0, 1].
[[nodiscard]] double linear_from_srgb(double encoded);
/// Returns the encoded value of linear light; both in [0, 1].
[[nodiscard]] double srgb_from_linear(double linear);

/// Returns the linear light of each of the 256 code values.
[[nodiscard]] const std::array<double, 256>& linear_of_codes();

/// Returns the code value nearest to an encoded value; NaN is black. Without branches, so that
/// compilers vectorise loops over this function.
[[nodiscard]] inline uint8_t code_from_encoded(float encoded) {
  const float above = encoded > 0.0F ? encoded : 0.0F;
  const float held = above < 1.0F ? above : 1.0F;
  return static_cast<uint8_t>(static_cast<int>(double{held} * 255.0 + 0.5));
}

/// Returns the code value nearest to the encoded light; light outside [0, 1] is clipped, NaN is
/// black.
[[nodiscard]] uint8_t code_from_linear(double linear);

/// Returns the code value nearest to a value of 16 bits: 65535 = 257 * 255, and 257 is odd, so no
/// value lies half way between two codes.
[[nodiscard]] inline uint8_t code_from_16_bits(uint16_t value) {
  return static_cast<uint8_t>((value + 128) / 257);
}
/// Returns a value of 16 bits as a part of the largest one.
[[nodiscard]] inline float fraction_of_16_bits(uint16_t value) {
  return static_cast<float>(value) / 65535.0F;
}
/// Returns the linear light of an encoded value of 16 bits.
[[nodiscard]] inline float linear_from_16_bits(uint16_t value) {
  return static_cast<float>(linear_from_srgb(value / 65535.0));
}

}  // namespace lenticule::frames
