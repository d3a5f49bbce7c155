// SPDX-License-Identifier: Apache-2.0
// ScanoutKernel holds the inner loops of scanout_format.cpp, compiled once per instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/cpu.h"
#include "display/scanout_depth.h"

namespace lenticule::display {

/// TurnedPixels says where the pixels of a turned picture lie in an RGB frame. Of the two steps one
/// is 3 or -3 bytes, the other a row of the frame or minus a row.
struct TurnedPixels {
  const uint8_t* first = nullptr;  ///< pixel that is scanned out first
  ptrdiff_t column_step = 3;       ///< bytes to the pixel that is scanned out next in the row
  ptrdiff_t row_step = 0;          ///< bytes to the pixel that is scanned out below

  [[nodiscard]] TurnedPixels from(size_t column, size_t row) const {
    return {first + static_cast<ptrdiff_t>(column) * column_step +
                static_cast<ptrdiff_t>(row) * row_step,
            column_step, row_step};
  }
};

/// ScanoutLoops holds the inner loops for one number of bits per colour.
struct ScanoutLoops {
  void (*expand_row)(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept;
  void (*pack_row)(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept;
  /// Expands at most kTurnedTile columns and rows of a turned picture; `stride` is in words.
  void (*expand_turned)(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                        size_t rows) noexcept;
};

struct ScanoutKernel {
  ScanoutLoops bits_8;
  ScanoutLoops bits_10;

  [[nodiscard]] const ScanoutLoops& loops(ScanoutDepth depth) const {
    return depth == ScanoutDepth::Bits10 ? bits_10 : bits_8;
  }
};

/// Side of the squares in which pictures are turned: few enough rows for the page tables' cache.
inline constexpr size_t kTurnedTile = 64;

LENTICULE_DECLARE_KERNEL(ScanoutKernel, kScanoutKernel)

}  // namespace lenticule::display
