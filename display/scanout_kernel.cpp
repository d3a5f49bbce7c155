// SPDX-License-Identifier: Apache-2.0
// Converts RGB bytes to and from XRGB8888 words. Scan-out memory may be uncached, so each word is
// written once, in ascending order.
#include "display/scanout_kernel.h"

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
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

void expand_turned_pixels(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                          size_t rows) noexcept {
  for (size_t j = 0; j < rows; ++j)
    for (size_t i = 0; i < columns; ++i)
      expand_pixel(pixels.from(i, j).first, xrgb + j * stride + i);
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

/// Expands eight pixels that follow each other in memory with the given step, 3 or -3 bytes. Reads
/// exactly their 24 bytes.
__m256i eight_pixels(const uint8_t* rgb, ptrdiff_t step) noexcept {
  const uint8_t* const lowest = step < 0 ? rgb - 21 : rgb;
  const __m128i low = _mm_loadu_si128(reinterpret_cast<const __m128i*>(lowest));
  const __m128i high = _mm_loadu_si128(reinterpret_cast<const __m128i*>(lowest + 8));
  if (step < 0)
    return _mm256_shuffle_epi8(
        _mm256_set_m128i(low, high),
        _mm256_setr_epi8(15, 14, 13, -1, 12, 11, 10, -1, 9, 8, 7, -1, 6, 5, 4, -1, 11, 10, 9, -1, 8,
                         7, 6, -1, 5, 4, 3, -1, 2, 1, 0, -1));
  return _mm256_shuffle_epi8(
      _mm256_set_m128i(high, low),
      _mm256_setr_epi8(2, 1, 0, -1, 5, 4, 3, -1, 8, 7, 6, -1, 11, 10, 9, -1, 6, 5, 4, -1, 9, 8, 7,
                       -1, 12, 11, 10, -1, 15, 14, 13, -1));
}

void store_eight(uint32_t* xrgb, __m256i words) noexcept {
  if (reinterpret_cast<uintptr_t>(xrgb) % sizeof(__m256i) == 0)
    _mm256_stream_si256(reinterpret_cast<__m256i*>(xrgb), words);
  else
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(xrgb), words);
}

/// Expands eight columns and rows whose columns are rows of the frame.
void expand_swapped_eight(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride) noexcept {
  __m256i in[8], pairs[8], fours[8];
  for (size_t i = 0; i < 8; ++i) in[i] = eight_pixels(pixels.from(i, 0).first, pixels.row_step);
  for (size_t i = 0; i < 8; i += 2) {
    pairs[i] = _mm256_unpacklo_epi32(in[i], in[i + 1]);
    pairs[i + 1] = _mm256_unpackhi_epi32(in[i], in[i + 1]);
  }
  for (size_t i = 0; i < 8; i += 4)
    for (size_t half = 0; half < 2; ++half) {
      fours[i + 2 * half] = _mm256_unpacklo_epi64(pairs[i + half], pairs[i + 2 + half]);
      fours[i + 2 * half + 1] = _mm256_unpackhi_epi64(pairs[i + half], pairs[i + 2 + half]);
    }
  for (size_t j = 0; j < 4; ++j) {
    store_eight(xrgb + j * stride, _mm256_permute2x128_si256(fours[j], fours[j + 4], 0x20));
    store_eight(xrgb + (j + 4) * stride, _mm256_permute2x128_si256(fours[j], fours[j + 4], 0x31));
  }
}

void expand_turned(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                   size_t rows) noexcept {
  const bool swapped = pixels.row_step == 3 || pixels.row_step == -3;
  const size_t whole_columns = columns / 8 * 8;
  const size_t whole_rows = swapped ? rows / 8 * 8 : rows;
  for (size_t j = 0; j < whole_rows; j += swapped ? 8 : 1)
    for (size_t i = 0; i < whole_columns; i += 8) {
      const TurnedPixels from = pixels.from(i, j);
      uint32_t* const to = xrgb + j * stride + i;
      if (swapped)
        expand_swapped_eight(from, to, stride);
      else
        store_eight(to, eight_pixels(from.first, from.column_step));
    }
  expand_turned_pixels(pixels.from(whole_columns, 0), xrgb + whole_columns, stride,
                       columns - whole_columns, whole_rows);
  expand_turned_pixels(pixels.from(0, whole_rows), xrgb + whole_rows * stride, stride, columns,
                       rows - whole_rows);
  _mm_sfence();
}

#elif defined(LENTICULE_NEON)

constexpr size_t kStep = 16;  ///< pixels per step

uint8x16_t reversed(uint8x16_t bytes) noexcept {
  const uint8x16_t halves = vrev64q_u8(bytes);
  return vextq_u8(halves, halves, 8);
}

void store_step(uint8x16_t red, uint8x16_t green, uint8x16_t blue, uint32_t* xrgb) noexcept {
  vst4q_u8(reinterpret_cast<uint8_t*>(xrgb), uint8x16x4_t{{blue, green, red, vdupq_n_u8(0)}});
}

void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  size_t i = 0;
  for (; i + kStep <= pixels; i += kStep) {
    const uint8x16x3_t in = vld3q_u8(rgb + 3 * i);
    store_step(in.val[0], in.val[1], in.val[2], xrgb + i);
  }
  for (; i < pixels; ++i) expand_pixel(rgb + 3 * i, xrgb + i);
}

void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  size_t i = 0;
  for (; i + kStep <= pixels; i += kStep) {
    const uint8x16x4_t in = vld4q_u8(reinterpret_cast<const uint8_t*>(xrgb + i));
    vst3q_u8(rgb + 3 * i, uint8x16x3_t{{in.val[2], in.val[1], in.val[0]}});
  }
  for (; i < pixels; ++i) pack_pixel(xrgb[i], rgb + 3 * i);
}

/// Expands a row whose pixels follow each other backwards in memory; `rgb` is the last in memory.
void expand_reversed_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  size_t i = 0;
  for (; i + kStep <= pixels; i += kStep) {
    const uint8x16x3_t in = vld3q_u8(rgb - 3 * (i + kStep - 1));
    store_step(reversed(in.val[0]), reversed(in.val[1]), reversed(in.val[2]), xrgb + i);
  }
  for (; i < pixels; ++i) expand_pixel(rgb - 3 * i, xrgb + i);
}

void expand_turned(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                   size_t rows) noexcept {
  if (pixels.column_step != 3 && pixels.column_step != -3)
    return expand_turned_pixels(pixels, xrgb, stride, columns, rows);
  const auto expand = pixels.column_step == 3 ? expand_row : expand_reversed_row;
  for (size_t j = 0; j < rows; ++j) expand(pixels.from(0, j).first, xrgb + j * stride, columns);
}

#else

void expand_turned(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                   size_t rows) noexcept {
  expand_turned_pixels(pixels, xrgb, stride, columns, rows);
}

void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  for (size_t i = 0; i < pixels; ++i) expand_pixel(rgb + 3 * i, xrgb + i);
}

void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  for (size_t i = 0; i < pixels; ++i) pack_pixel(xrgb[i], rgb + 3 * i);
}

#endif

}  // namespace

const ScanoutKernel kScanoutKernel{
    .expand_row = expand_row, .pack_row = pack_row, .expand_turned = expand_turned};

}  // namespace lenticule::display::LENTICULE_ISA_NAMESPACE
