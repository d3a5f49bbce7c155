// SPDX-License-Identifier: Apache-2.0
// SubsampledKernel converts 8-bit Y'CbCr whose chroma has half the columns, in 16-bit arithmetic.
// Plain data only; all variants give the same bytes.
//
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

#include "apps/lenticule-video/pixel_kernel.h"
#include "base/cpu.h"

namespace lenticule::video {

inline constexpr int kShortFraction = 6;  ///< binary places of the sums

struct ShortSums {
  int16_t luma, constant;
  int16_t red_cr, green_cb, green_cr, blue_cb;
  /// Weights of the chroma samples k - 1 and k at pixel 2 k, and of k and k + 1 at pixel 2 k + 1.
  PairWeights even, odd;
};

struct SubsampledKernel {
  /// Writes the weighted sums of two rows of bytes.
  void (*mix_bytes)(const uint8_t* a, const uint8_t* b, PairWeights weights, int count,
                    int16_t* out) noexcept;
  /// Converts `count` pixels, a multiple of kPixelPadding. Reads the chroma samples from -1 on to
  /// count / 2.
  void (*convert)(const ShortSums& sums, const uint8_t* y, const int16_t* cb, const int16_t* cr,
                  int count, uint8_t* rgb) noexcept;
};

LENTICULE_DECLARE_KERNEL(SubsampledKernel, kSubsampledKernel)

/// Returns the best variant that does not exceed `isa` and that this machine can run. The variant
/// for AVX-512 needs VBMI, too.
[[nodiscard]] const SubsampledKernel& subsampled_kernel(Isa isa);

}  // namespace lenticule::video
