// SPDX-License-Identifier: Apache-2.0
// Converts RGB bytes to and from XRGB8888 words. Scan-out memory may be uncached, so each word is
// written once, in ascending order.
#include "display/scanout_kernel.h"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace lenticule::display::LENTICULE_ISA_NAMESPACE {
namespace {

void expand_pixel(const uint8_t* rgb, uint32_t* xrgb) noexcept {
  *xrgb = static_cast<uint32_t>(rgb[0]) << 16 | static_cast<uint32_t>(rgb[1]) << 8 |
          static_cast<uint32_t>(rgb[2]);
}

void pack_pixel(uint32_t xrgb, uint8_t* rgb) noexcept {
  rgb[0] = static_cast<uint8_t>(xrgb >> 16);
  rgb[1] = static_cast<uint8_t>(xrgb >> 8);
  rgb[2] = static_cast<uint8_t>(xrgb);
}

#if defined(__AVX2__)

// Eight pixels per step: 12 bytes are loaded into each half of the register and swapped to B G R 0
// in place. Every load reads 16 bytes, so the last six pixels of a row are left to the scalar loop.
void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  constexpr size_t kStep = 8;
  constexpr size_t kOverread = 2;  // pixels that the second load reads beyond its own
  size_t i = 0;
  while (i < pixels && reinterpret_cast<uintptr_t>(xrgb + i) % sizeof(__m256i) != 0) {
    expand_pixel(rgb + 3 * i, xrgb + i);
    ++i;
  }
  const __m256i swap = _mm256_setr_epi8(2, 1, 0, -1, 5, 4, 3, -1, 8, 7, 6, -1, 11, 10, 9, -1, 2, 1,
                                        0, -1, 5, 4, 3, -1, 8, 7, 6, -1, 11, 10, 9, -1);
  for (; i + kStep + kOverread <= pixels; i += kStep) {
    const __m128i low = _mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 3 * i));
    const __m128i high = _mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 3 * i + 12));
    const __m256i both = _mm256_set_m128i(high, low);
    _mm256_stream_si256(reinterpret_cast<__m256i*>(xrgb + i), _mm256_shuffle_epi8(both, swap));
  }
  for (; i < pixels; ++i) expand_pixel(rgb + 3 * i, xrgb + i);
  _mm_sfence();
}

// Four pixels per step; the 16-byte store writes 4 bytes into the next pixels, which the next step
// overwrites.
void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  constexpr size_t kStep = 4;
  constexpr size_t kSpill = 2;  // pixels that the store writes beyond its own
  const __m128i swap = _mm_setr_epi8(2, 1, 0, 6, 5, 4, 10, 9, 8, 14, 13, 12, -1, -1, -1, -1);
  size_t i = 0;
  for (; i + kStep + kSpill <= pixels; i += kStep) {
    const __m128i words = _mm_loadu_si128(reinterpret_cast<const __m128i*>(xrgb + i));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(rgb + 3 * i), _mm_shuffle_epi8(words, swap));
  }
  for (; i < pixels; ++i) pack_pixel(xrgb[i], rgb + 3 * i);
}

#else

void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  for (size_t i = 0; i < pixels; ++i) expand_pixel(rgb + 3 * i, xrgb + i);
}

void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  for (size_t i = 0; i < pixels; ++i) pack_pixel(xrgb[i], rgb + 3 * i);
}

#endif

}  // namespace

const ScanoutKernel kScanoutKernel{.expand_row = expand_row, .pack_row = pack_row};

}  // namespace lenticule::display::LENTICULE_ISA_NAMESPACE
