// SPDX-License-Identifier: Apache-2.0
// PixelKernel holds the inner loops of pixel_convert.cpp, compiled once per instruction set. Plain
// data only; all variants give the same bytes.
//
// 8-bit Y'CbCr whose chroma has half the columns is converted in 16 bits.
// A sum of chroma is sum(k) = weights of two samples, in 2^-8 codes, minus 2^15: the distance from
// grey. With product(a, b) = (a b + 2^14) >> 15, in 2^-6 codes:
//    luma  = product(128 Y', Coefficients::luma) + constant
//    red   = luma + product(Cr, red_cr)
//    green = luma + product(Cb, green_cb) + product(Cr, green_cr)
//    blue  = luma + product(Cb, blue_cb)
// A code is one of them, shifted right by 6 and clipped. The error before rounding is below 1/16
// code; greys are exact.
#pragma once

#include <cstdint>

#include "base/cpu.h"

namespace lenticule::video {

/// Binary places of the sums below: sums of up to 2^9.5 codes fit into 32 bits.
inline constexpr int kSumFraction = 21;

/// Sums holds the coefficients of the three channels' sums in 2^-kSumFraction codes, per code value
/// of luma and per part of a chroma code value. The constants include half a code.
struct Sums {
  int32_t luma;
  int32_t red_cr, green_cb, green_cr, blue_cb;
  int32_t red_0, green_0, blue_0;
  int32_t error;  ///< upper limit of the error of a sum
};

/// Weights of two neighbours: first * a + second * b.
struct PairWeights {
  int first, second;
};

inline constexpr int kShortFraction = 6;  ///< binary places of the sums

struct ShortSums {
  int16_t luma, constant;
  int16_t red_cr, green_cb, green_cr, blue_cb;
  /// Weights of the chroma samples k - 1 and k at pixel 2 k, and of k and k + 1 at pixel 2 k + 1.
  PairWeights even, odd;
};

struct PixelKernel {
  /// Write the weighted sums of two rows.
  void (*mix_rows)(const uint16_t* a, const uint16_t* b, PairWeights weights, int count,
                   int16_t* out) noexcept;
  void (*mix_bytes)(const uint8_t* a, const uint8_t* b, PairWeights weights, int count,
                    int16_t* out) noexcept;
  /// Writes two values per chroma sample k: first the weighted sum of the samples k - 1 and k, then
  /// that of k and k + 1. The samples -1 and `samples` must be readable.
  void (*spread)(const int16_t* in, PairWeights even, PairWeights odd, int samples,
                 int16_t* out) noexcept;
  /// Converts `count` pixels to RGB. Sets `doubtful` to 1 for pixels of which a sum is so close to
  /// the middle between two codes that its error may decide, otherwise to 0. Writes up to
  /// kPixelPadding pixels more, and reads as many.
  void (*convert)(const Sums& sums, const uint16_t* y, const int16_t* cb, const int16_t* cr,
                  int count, uint8_t* rgb, uint8_t* doubtful) noexcept;
  /// Converts `count` pixels in 16 bits, a multiple of kPixelPadding. Reads the chroma samples from
  /// -1 on to count / 2.
  void (*convert_short)(const ShortSums& sums, const uint8_t* y, const int16_t* cb,
                        const int16_t* cr, int count, uint8_t* rgb) noexcept;
};
inline constexpr int kPixelPadding = 64;

LENTICULE_DECLARE_KERNEL(PixelKernel, kPixelKernel)

/// Returns the best variant that does not exceed `isa` and that this machine can run. The variant
/// for AVX-512 needs VBMI, too.
[[nodiscard]] const PixelKernel& pixel_kernel(Isa isa);

}  // namespace lenticule::video
