// SPDX-License-Identifier: Apache-2.0
// Converts RGB bytes to and from scan-out words. Scan-out memory may be uncached, so each word is
// written once, in ascending order.
//
// Ten bits per colour: value v of 8 bits becomes v * 1023 / 255, rounded, which is 4 v + v / 85,
// rounded: 4 v, and one more from each of 43, 128 and 213 on. The upper eight of the ten bits are
// v itself. scanout_format.h states the rule.
#include "display/scanout_kernel.h"

#include <array>

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
#endif

namespace lenticule::display::LENTICULE_ISA_NAMESPACE {
namespace {

using enum ScanoutDepth;

/// Values from which the ten bits are one more than four times the eight bits, two more, three.
constexpr uint8_t kThresholds[] = {43, 128, 213};

/// The ten bits of every value, for the pixels that are not converted by vectors.
constexpr std::array<uint16_t, 256> kTenBits = [] {
  std::array<uint16_t, 256> ten{};
  for (unsigned value = 0; value < ten.size(); ++value) {
    unsigned bits = value << 2;
    for (const uint8_t threshold : kThresholds) bits += value >= threshold ? 1 : 0;
    ten[value] = static_cast<uint16_t>(bits);
  }
  return ten;
}();

uint32_t ten_bits(uint8_t value) noexcept { return kTenBits[value]; }

template <ScanoutDepth depth>
void expand_pixel(const uint8_t* rgb, uint32_t* xrgb) noexcept {
  if constexpr (depth == Bits10)
    *xrgb = ten_bits(rgb[0]) << 20 | ten_bits(rgb[1]) << 10 | ten_bits(rgb[2]);
  else
    *xrgb = static_cast<uint32_t>(rgb[0]) << 16 | static_cast<uint32_t>(rgb[1]) << 8 |
            static_cast<uint32_t>(rgb[2]);
}

template <ScanoutDepth depth>
void pack_pixel(uint32_t xrgb, uint8_t* rgb) noexcept {
  constexpr int kBits = depth == Bits10 ? 10 : 8;
  xrgb >>= kBits - 8;
  rgb[0] = static_cast<uint8_t>(xrgb >> 2 * kBits);
  rgb[1] = static_cast<uint8_t>(xrgb >> kBits);
  rgb[2] = static_cast<uint8_t>(xrgb);
}

template <ScanoutDepth depth>
void expand_turned_pixels(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                          size_t rows) noexcept {
  for (size_t j = 0; j < rows; ++j)
    for (size_t i = 0; i < columns; ++i)
      expand_pixel<depth>(pixels.from(i, j).first, xrgb + j * stride + i);
}

#if defined(__AVX2__)

/// Moves the bytes of each word (blue, green, red, 0) apart to ten bits per colour.
__m256i spread(__m256i bytes) noexcept {
  const __m256i blue = _mm256_and_si256(bytes, _mm256_set1_epi32(0xff));
  const __m256i green = _mm256_and_si256(bytes, _mm256_set1_epi32(0xff00));
  const __m256i red = _mm256_and_si256(bytes, _mm256_set1_epi32(0xff0000));
  return _mm256_or_si256(blue,
                         _mm256_or_si256(_mm256_slli_epi32(green, 2), _mm256_slli_epi32(red, 4)));
}

/// Returns the words of `depth` for words of 8 bits per colour.
template <ScanoutDepth depth>
__m256i deepened(__m256i bytes) noexcept {
  if constexpr (depth == Bits8) return bytes;
  __m256i more = _mm256_setzero_si256();
  for (const uint8_t threshold : kThresholds) {
    const __m256i limit = _mm256_set1_epi8(static_cast<char>(threshold));
    // A byte that reaches the threshold compares as -1.
    more = _mm256_sub_epi8(more, _mm256_cmpeq_epi8(_mm256_max_epu8(bytes, limit), bytes));
  }
  return _mm256_or_si256(_mm256_slli_epi32(spread(bytes), 2), spread(more));
}

#if defined(__AVX512BW__)
/// Converts sixteen pixels per step, which fill a cache line, from the first whole line on, and
/// returns the number of pixels that are done.
size_t expand_lines(const uint8_t* rgb, uint32_t* xrgb, size_t begin, size_t pixels) noexcept {
  constexpr size_t kStep = 16;
  // Three double words hold four pixels. Each part of the register gets three and one of no use.
  const __m512i parts = _mm512_setr_epi32(0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 8, 8, 9, 10, 11, 11);
  const __m512i swap =
      _mm512_broadcast_i32x4(_mm_setr_epi8(2, 1, 0, -1, 5, 4, 3, -1, 8, 7, 6, -1, 11, 10, 9, -1));
  size_t i = begin;
  for (; i + kStep <= pixels; i += kStep) {
    const __m512i bytes = _mm512_maskz_loadu_epi32(0x0fff, rgb + 3 * i);
    _mm512_stream_si512(reinterpret_cast<__m512i*>(xrgb + i),
                        _mm512_shuffle_epi8(_mm512_permutexvar_epi32(parts, bytes), swap));
  }
  return i;
}
#endif

// Eight pixels per step: 12 bytes are loaded into each half of the register and swapped to B G R 0
// in place. Every load reads 16 bytes, so the last six pixels of a row are left to the scalar loop.
template <ScanoutDepth depth>
void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  constexpr size_t kStep = 8;
  constexpr size_t kOverread = 2;  // pixels that the second load reads beyond its own
  constexpr size_t kLine = 64;     // bytes that are written at once if they are aligned
  size_t i = 0;
  while (i < pixels && reinterpret_cast<uintptr_t>(xrgb + i) % kLine != 0) {
    expand_pixel<depth>(rgb + 3 * i, xrgb + i);
    ++i;
  }
#if defined(__AVX512BW__)
  if constexpr (depth == Bits8) i = expand_lines(rgb, xrgb, i, pixels);
#endif
  const __m256i swap = _mm256_setr_epi8(2, 1, 0, -1, 5, 4, 3, -1, 8, 7, 6, -1, 11, 10, 9, -1, 2, 1,
                                        0, -1, 5, 4, 3, -1, 8, 7, 6, -1, 11, 10, 9, -1);
  for (; i + kStep + kOverread <= pixels; i += kStep) {
    const __m128i low = _mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 3 * i));
    const __m128i high = _mm_loadu_si128(reinterpret_cast<const __m128i*>(rgb + 3 * i + 12));
    const __m256i both = _mm256_set_m128i(high, low);
    _mm256_stream_si256(reinterpret_cast<__m256i*>(xrgb + i),
                        deepened<depth>(_mm256_shuffle_epi8(both, swap)));
  }
  for (; i < pixels; ++i) expand_pixel<depth>(rgb + 3 * i, xrgb + i);
  _mm_sfence();
}

/// Returns words of 8 bits per colour for words of `depth`.
template <ScanoutDepth depth>
__m128i shallow(__m128i words) noexcept {
  if constexpr (depth == Bits8) return words;
  const __m128i blue = _mm_and_si128(_mm_srli_epi32(words, 2), _mm_set1_epi32(0xff));
  const __m128i green = _mm_and_si128(_mm_srli_epi32(words, 4), _mm_set1_epi32(0xff00));
  const __m128i red = _mm_and_si128(_mm_srli_epi32(words, 6), _mm_set1_epi32(0xff0000));
  return _mm_or_si128(blue, _mm_or_si128(green, red));
}

// Four pixels per step; the 16-byte store writes 4 bytes into the next pixels, which the next step
// overwrites.
template <ScanoutDepth depth>
void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  constexpr size_t kStep = 4;
  constexpr size_t kSpill = 2;  // pixels that the store writes beyond its own
  const __m128i swap = _mm_setr_epi8(2, 1, 0, 6, 5, 4, 10, 9, 8, 14, 13, 12, -1, -1, -1, -1);
  size_t i = 0;
  for (; i + kStep + kSpill <= pixels; i += kStep) {
    const __m128i words = _mm_loadu_si128(reinterpret_cast<const __m128i*>(xrgb + i));
    _mm_storeu_si128(reinterpret_cast<__m128i*>(rgb + 3 * i),
                     _mm_shuffle_epi8(shallow<depth>(words), swap));
  }
  for (; i < pixels; ++i) pack_pixel<depth>(xrgb[i], rgb + 3 * i);
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
template <ScanoutDepth depth>
void expand_swapped_eight(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride) noexcept {
  __m256i in[8], pairs[8], fours[8];
  for (size_t i = 0; i < 8; ++i)
    in[i] = deepened<depth>(eight_pixels(pixels.from(i, 0).first, pixels.row_step));
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

template <ScanoutDepth depth>
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
        expand_swapped_eight<depth>(from, to, stride);
      else
        store_eight(to, deepened<depth>(eight_pixels(from.first, from.column_step)));
    }
  expand_turned_pixels<depth>(pixels.from(whole_columns, 0), xrgb + whole_columns, stride,
                              columns - whole_columns, whole_rows);
  expand_turned_pixels<depth>(pixels.from(0, whole_rows), xrgb + whole_rows * stride, stride,
                              columns, rows - whole_rows);
  _mm_sfence();
}

#elif defined(LENTICULE_NEON)

constexpr size_t kStep = 16;  ///< pixels per step

uint8x16_t reversed(uint8x16_t bytes) noexcept {
  const uint8x16_t halves = vrev64q_u8(bytes);
  return vextq_u8(halves, halves, 8);
}

/// Returns how much more than four times the value its ten bits are.
uint8x16_t more_of(uint8x16_t value) noexcept {
  uint8x16_t more = vdupq_n_u8(0);
  for (const uint8_t threshold : kThresholds)
    more = vsubq_u8(more, vcgeq_u8(value, vdupq_n_u8(threshold)));  // true is -1
  return more;
}

/// Returns the four bytes of words of ten bits per colour, from the lowest.
uint8x16x4_t ten_bit_words(uint8x16_t red, uint8x16_t green, uint8x16_t blue) noexcept {
  const uint8x16_t lowest = vorrq_u8(vshlq_n_u8(blue, 2), more_of(blue));
  const uint8x16_t low =
      vorrq_u8(vshrq_n_u8(blue, 6), vorrq_u8(vshlq_n_u8(more_of(green), 2), vshlq_n_u8(green, 4)));
  const uint8x16_t high =
      vorrq_u8(vshrq_n_u8(green, 4), vorrq_u8(vshlq_n_u8(more_of(red), 4), vshlq_n_u8(red, 6)));
  return {{lowest, low, high, vshrq_n_u8(red, 2)}};
}

template <ScanoutDepth depth>
void store_step(uint8x16_t red, uint8x16_t green, uint8x16_t blue, uint32_t* xrgb) noexcept {
  uint8x16x4_t words = {{blue, green, red, vdupq_n_u8(0)}};
  if constexpr (depth == Bits10) words = ten_bit_words(red, green, blue);
  vst4q_u8(reinterpret_cast<uint8_t*>(xrgb), words);
}

template <ScanoutDepth depth>
void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  size_t i = 0;
  for (; i + kStep <= pixels; i += kStep) {
    const uint8x16x3_t in = vld3q_u8(rgb + 3 * i);
    store_step<depth>(in.val[0], in.val[1], in.val[2], xrgb + i);
  }
  for (; i < pixels; ++i) expand_pixel<depth>(rgb + 3 * i, xrgb + i);
}

/// Returns red, green and blue of 8 bits from the four bytes of words.
template <ScanoutDepth depth>
uint8x16x3_t colours_of(const uint8x16x4_t& in) noexcept {
  if constexpr (depth == Bits8) return {{in.val[2], in.val[1], in.val[0]}};
  return {{vorrq_u8(vshlq_n_u8(in.val[3], 2), vshrq_n_u8(in.val[2], 6)),
           vorrq_u8(vshlq_n_u8(in.val[2], 4), vshrq_n_u8(in.val[1], 4)),
           vorrq_u8(vshlq_n_u8(in.val[1], 6), vshrq_n_u8(in.val[0], 2))}};
}

template <ScanoutDepth depth>
void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  size_t i = 0;
  for (; i + kStep <= pixels; i += kStep)
    vst3q_u8(rgb + 3 * i, colours_of<depth>(vld4q_u8(reinterpret_cast<const uint8_t*>(xrgb + i))));
  for (; i < pixels; ++i) pack_pixel<depth>(xrgb[i], rgb + 3 * i);
}

/// Expands a row whose pixels follow each other backwards in memory; `rgb` is the last in memory.
template <ScanoutDepth depth>
void expand_reversed_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  size_t i = 0;
  for (; i + kStep <= pixels; i += kStep) {
    const uint8x16x3_t in = vld3q_u8(rgb - 3 * (i + kStep - 1));
    store_step<depth>(reversed(in.val[0]), reversed(in.val[1]), reversed(in.val[2]), xrgb + i);
  }
  for (; i < pixels; ++i) expand_pixel<depth>(rgb - 3 * i, xrgb + i);
}

template <ScanoutDepth depth>
void expand_turned(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                   size_t rows) noexcept {
  if (pixels.column_step != 3 && pixels.column_step != -3)
    return expand_turned_pixels<depth>(pixels, xrgb, stride, columns, rows);
  const auto expand = pixels.column_step == 3 ? expand_row<depth> : expand_reversed_row<depth>;
  for (size_t j = 0; j < rows; ++j) expand(pixels.from(0, j).first, xrgb + j * stride, columns);
}

#else

template <ScanoutDepth depth>
void expand_turned(const TurnedPixels& pixels, uint32_t* xrgb, size_t stride, size_t columns,
                   size_t rows) noexcept {
  expand_turned_pixels<depth>(pixels, xrgb, stride, columns, rows);
}

template <ScanoutDepth depth>
void expand_row(const uint8_t* rgb, uint32_t* xrgb, size_t pixels) noexcept {
  for (size_t i = 0; i < pixels; ++i) expand_pixel<depth>(rgb + 3 * i, xrgb + i);
}

template <ScanoutDepth depth>
void pack_row(const uint32_t* xrgb, uint8_t* rgb, size_t pixels) noexcept {
  for (size_t i = 0; i < pixels; ++i) pack_pixel<depth>(xrgb[i], rgb + 3 * i);
}

#endif

template <ScanoutDepth depth>
constexpr ScanoutLoops loops_of() {
  return {.expand_row = expand_row<depth>,
          .pack_row = pack_row<depth>,
          .expand_turned = expand_turned<depth>};
}

}  // namespace

const ScanoutKernel kScanoutKernel{.bits_8 = loops_of<Bits8>(), .bits_10 = loops_of<Bits10>()};

}  // namespace lenticule::display::LENTICULE_ISA_NAMESPACE
