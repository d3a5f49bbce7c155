// SPDX-License-Identifier: Apache-2.0
#include "display/scanout_format.h"

#include "display/scanout_kernel.h"

namespace lenticule::display {
namespace {

Isa chosen_isa() noexcept {
  static const Isa isa = best_isa();
  return isa;
}

}  // namespace

void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  expand_row(chosen_isa(), rgb, xrgb, pixels);
}

void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  pack_row(chosen_isa(), xrgb, rgb, pixels);
}

void expand_row(Isa isa, const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return isa_avx512::expand_row(rgb, xrgb, pixels);
  if (isa == Isa::Avx2) return isa_avx2::expand_row(rgb, xrgb, pixels);
#endif
  (void)isa;
  isa_baseline::expand_row(rgb, xrgb, pixels);
}

void pack_row(Isa isa, const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
#if defined(__x86_64__)
  if (isa == Isa::Avx512) return isa_avx512::pack_row(xrgb, rgb, pixels);
  if (isa == Isa::Avx2) return isa_avx2::pack_row(xrgb, rgb, pixels);
#endif
  (void)isa;
  isa_baseline::pack_row(xrgb, rgb, pixels);
}

}  // namespace lenticule::display
