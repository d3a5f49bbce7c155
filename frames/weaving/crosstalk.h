// SPDX-License-Identifier: Apache-2.0
// Crosstalk compensation: a lens's spot also shows an eye the neighbouring views. The views are
// changed beforehand so that the light that reaches the eye is closer to the intended view.
//
// With W the weight of each view for an eye in the middle of each view, the compensated views L'
// minimise |W L' - L|^2 + e |L' - L|^2 in linear light, per pixel and colour, and are clamped to
// the panel's range. e = 0 where W is well-conditioned.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "frames/quilt.h"

namespace lenticule::frames {

// Linear light in 15 bits, as the fast weaver mixes it, and the conversion back to code values in
// integer arithmetic, which all instruction sets compute alike.
//
// Neighbouring codes are at least 10 units of light apart, so that an error of 3 units is a third
// of a level where the curve is steepest. The light of codes is a parabola for each 16 codes, with
// an error of at most 1.6 units, so that kernels can compute it where a table of 256 entries is
// slow. Encoding is linear between 64 points below 1/16 of full light and 64 points above, with an
// error of at most 0.17 level.

/// LightCurve holds the parabolas: code 16 n + t has the light start + ((t (rise + ((t bend + 4) >>
/// 3)) + 4) >> 3) with the coefficients of part n, in unsigned 16 bits.
struct LightCurve {
  alignas(16) std::array<uint8_t, 16> start_low, start_high, rise_low, rise_high, bend;
};
[[nodiscard]] const LightCurve& light_curve();

/// Returns the light of each code value, 0..32767, by the light curve.
[[nodiscard]] const std::array<uint16_t, 256>& light_of_codes15();

/// EncodingCurve holds the points of the encoding curve: code = (start[n] + rounded(rise[n] * part
/// / 2^15)) >> 7, where the lower part of the curve has n = light / 32 and the upper n = light /
/// 512, and `part` is the remainder as 15 bits. `start` includes half a code.
struct EncodingCurve {
  alignas(64) std::array<int16_t, 64> low_start, low_rise, high_start, high_rise;
};
inline constexpr int kLowLight = 2048;  ///< light below this uses the lower points
[[nodiscard]] const EncodingCurve& encoding_curve();

/// Returns the code of each light 0..32767 by the encoding curve.
[[nodiscard]] const std::array<uint8_t, 32768>& codes_of_light15();

struct Crosstalk {
  /// Weights of the view itself, of each neighbour, of each second neighbour, ...: at the ends of
  /// the lobe the missing weights are distributed over the others.
  std::vector<double> shares;
  double restraint = 0.0;  ///< e
};

/// Returns a crosstalk of `percent` of the light from the two neighbours together, 0 to 40. Throws
/// Error(Usage).
[[nodiscard]] Crosstalk crosstalk_of_percent(double percent);
/// Returns the crosstalk of a Gaussian spot with sigma in views. Wide spots cannot be inverted: e =
/// 0.01 limits the amplification of noise to five times.
[[nodiscard]] Crosstalk crosstalk_of_spot(double sigma_views);

/// Limit of views, since the dense system is solved.
inline constexpr int kMostCompensatedViews = 256;

/// Returns the matrix that multiplies the views, row by row; each row sums to 1.
[[nodiscard]] std::vector<double> compensation_matrix(const Crosstalk& crosstalk, int views);

/// Returns the compensated views. Throws Error(Usage) for more than kMostCompensatedViews views.
[[nodiscard]] ViewSet compensate(const ViewSet& views, const Crosstalk& crosstalk);

}  // namespace lenticule::frames
