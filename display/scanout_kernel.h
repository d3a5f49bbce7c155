// SPDX-License-Identifier: Apache-2.0
// ScanoutKernel holds the inner loops of scanout_format.cpp, compiled once per instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/cpu.h"

namespace lenticule::display {

struct ScanoutKernel {
  void (*expand_row)(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept;
  void (*pack_row)(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept;
};

LENTICULE_DECLARE_KERNEL(ScanoutKernel, kScanoutKernel)

}  // namespace lenticule::display
