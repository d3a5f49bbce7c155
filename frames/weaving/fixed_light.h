// SPDX-License-Identifier: Apache-2.0
// Linear light in 15 bits, as the fast weaver mixes it, and the way back to code values in integers
// that every instruction set computes alike.
//
// A code is 10 units of light or more apart from the next, so that a mix that is 3 units off is a
// third of a level off where the curve is steepest. Light of codes is a parabola between each 16 of
// them, at most 1.6 units off, so that it can be worked out where tables of 256 cannot be looked
// up. Encoding is linear between 64 points below 1/16 of full light and 64 points above: at most
// 0.17 level off.
#pragma once

#include <array>
#include <cstdint>

namespace lenticule::frames {

/// Parabolas: code 16 n + t has the light start + ((t (rise + ((t bend + 4) >> 3)) + 4) >> 3), all
/// of part n, in 16 bits without a sign.
struct LightCurve {
  alignas(16) std::array<uint8_t, 16> start_low, start_high, rise_low, rise_high, bend;
};
[[nodiscard]] const LightCurve& light_curve();

/// Light of each code value, 0..32767, by that curve.
[[nodiscard]] const std::array<uint16_t, 256>& light_of_codes15();

/// Points of the encoding curve: code = (start[n] + rounded(rise[n] * part / 2^15)) >> 7, where the
/// lower part of the curve has n = light / 32 and the upper n = light / 512, and `part` is the rest
/// as 15 bits. Half a code is in `start`.
struct EncodingCurve {
  alignas(64) std::array<int16_t, 64> low_start, low_rise, high_start, high_rise;
};
inline constexpr int kLowLight = 2048;  ///< below it the lower points count
[[nodiscard]] const EncodingCurve& encoding_curve();

/// The code of each light 0..32767 by that curve.
[[nodiscard]] const std::array<uint8_t, 32768>& codes_of_light15();

}  // namespace lenticule::frames
