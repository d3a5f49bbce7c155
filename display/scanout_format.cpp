// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_format.h"

#include "display/scanout_kernel.h"

namespace lenticule::display {
namespace {

const ScanoutKernel& best_kernel() noexcept {
  static const ScanoutKernel& kernel = LENTICULE_SELECT_KERNEL(best_isa(), kScanoutKernel);
  return kernel;
}

}  // namespace

void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  best_kernel().expand_row(rgb, xrgb, pixels);
}

void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  best_kernel().pack_row(xrgb, rgb, pixels);
}

void expand_row(Isa isa, const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  LENTICULE_SELECT_KERNEL(isa, kScanoutKernel).expand_row(rgb, xrgb, pixels);
}

void pack_row(Isa isa, const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  LENTICULE_SELECT_KERNEL(isa, kScanoutKernel).pack_row(xrgb, rgb, pixels);
}

}  // namespace lenticule::display
