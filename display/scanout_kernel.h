// SPDX-License-Identifier: Apache-2.0
// The inner loops of scanout_format.cpp, compiled once per instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#define LENTICULE_DECLARE_SCANOUT_KERNEL(name)                                 \
  namespace lenticule::display::name {                                         \
  void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept; \
  void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept;   \
  }

LENTICULE_DECLARE_SCANOUT_KERNEL(isa_baseline)
#if defined(__x86_64__)
LENTICULE_DECLARE_SCANOUT_KERNEL(isa_avx2)
LENTICULE_DECLARE_SCANOUT_KERNEL(isa_avx512)
#endif
