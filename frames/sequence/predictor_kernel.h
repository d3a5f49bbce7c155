// SPDX-License-Identifier: Apache-2.0
// The inner loops of band_codec.cpp, compiled once per instruction set. All variants give the same
// bytes. docs/content/formats.md describes blocks, predictors and the three streams.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/cpu.h"

namespace lenticule::frames {

inline constexpr size_t kBlockBytes = 32;    ///< unit of prediction
inline constexpr int kMaxPredictors = 15;    ///< number of predictors; index 0 is "predict zero"
inline constexpr uint8_t kHasResidual = 16;  ///< flag in a mode byte, above the predictor's index

/// PredictorTable holds the predictors of a block: distances in bytes to earlier data of the band.
struct PredictorTable {
  int count = 0;                               ///< 0..kMaxPredictors
  uint32_t distance[kMaxPredictors + 1] = {};  ///< [1..count], each at least kBlockBytes
};

/// PredictorStreams is the input of decoding a band. `masks` has kMaskPadding readable bytes after
/// the last mask, `values` kValuePadding after value_count.
struct PredictorStreams {
  const uint8_t* modes = nullptr;   ///< one per block
  const uint8_t* masks = nullptr;   ///< four bytes per block with a residual
  const uint8_t* values = nullptr;  ///< the residuals that are not zero
  size_t value_count = 0;
};
inline constexpr size_t kMaskPadding = 4;
inline constexpr size_t kValuePadding = kBlockBytes;

/// PredictorTarget is where a band is decoded to. `window` is `out` itself, or as much memory
/// beside it, from which blocks are predicted: `out` is then written past the caches and never
/// read, and is aligned to kBlockBytes.
struct PredictorTarget {
  uint8_t* out = nullptr;
  uint8_t* window = nullptr;
};

/// PredictorSource is a band to encode. With a largest error, `window` takes the band that the
/// decoder will have, in whole blocks: later blocks are predicted from it, so that errors do not
/// add up.
struct PredictorSource {
  const uint8_t* band = nullptr;
  size_t bytes = 0;
  uint8_t max_error = 0;      ///< code values, 0..kMostMaxError
  uint8_t* window = nullptr;  ///< unused without an error
};
inline constexpr int kMostMaxError = 16;

/// PredictorOutput is the output of encoding a band. Capacities per block: one byte of modes, four
/// bytes of masks, kBlockBytes bytes of values.
struct PredictorOutput {
  uint8_t* modes = nullptr;
  uint8_t* masks = nullptr;
  uint8_t* values = nullptr;
  size_t mask_bytes = 0;
  size_t value_bytes = 0;
};

/// PredictorKernel is the table of the inner loops.
struct PredictorKernel {
  /// Returns false if a mode names a missing predictor, or the number of values does not match the
  /// masks; the band is undefined then. The caller must have checked the number of masks before.
  bool (*decode_blocks)(const PredictorTable& predictors, const PredictorStreams& in,
                        const PredictorTarget& to, size_t bytes) noexcept;
  /// Chooses the cheapest predictor of every block.
  void (*encode_blocks)(const PredictorTable& predictors, const PredictorSource& source,
                        PredictorOutput& out) noexcept;
  /// Returns the cost of `block` if it is predicted from `from`, 0..5 * kBlockBytes.
  int (*predictor_cost)(const uint8_t* block, const uint8_t* from) noexcept;
  size_t (*count_residuals)(const uint8_t* modes, size_t count) noexcept;
  size_t (*count_bits)(const uint8_t* masks, size_t bytes) noexcept;
  bool streams;  ///< true if decode_blocks() takes a window beside `out`
};

LENTICULE_DECLARE_KERNEL(PredictorKernel, kPredictorKernel)

/// Returns the best variant that does not exceed `isa` and that this machine can run. The variant
/// for AVX-512 needs VBMI2, too.
[[nodiscard]] const PredictorKernel& predictor_kernel(Isa isa);

}  // namespace lenticule::frames
