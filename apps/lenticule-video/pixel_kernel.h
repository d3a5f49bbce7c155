// SPDX-License-Identifier: Apache-2.0
// PixelKernel holds the inner loops of pixel_convert.cpp, compiled once per instruction set. Plain
// data only; all variants give the same bytes.
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

struct PixelKernel {
  /// Writes the weighted sums of two rows.
  void (*mix_rows)(const uint16_t* a, const uint16_t* b, PairWeights weights, int count,
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
};
inline constexpr int kPixelPadding = 64;

LENTICULE_DECLARE_KERNEL(PixelKernel, kPixelKernel)

}  // namespace lenticule::video
