// SPDX-License-Identifier: Apache-2.0
// Converts rows of Y'CbCr to RGB: plain loops over arrays, which the compiler vectorises.
#include "apps/lenticule-video/pixel_kernel.h"

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
#endif

namespace lenticule::video::LENTICULE_ISA_NAMESPACE {
namespace {

constexpr int kBlock = kPixelPadding;  ///< pixels that are converted at once

void mix_rows(const uint16_t* a, const uint16_t* b, PairWeights weights, int count,
              int16_t* out) noexcept {
  for (int k = 0; k < count; ++k)
    out[k] = static_cast<int16_t>(weights.first * a[k] + weights.second * b[k]);
}

void spread(const int16_t* in, PairWeights even, PairWeights odd, int samples,
            int16_t* out) noexcept {
  for (int k = 0; k < samples; ++k) {
    out[2 * k] = static_cast<int16_t>(even.first * in[k - 1] + even.second * in[k]);
    out[2 * k + 1] = static_cast<int16_t>(odd.first * in[k] + odd.second * in[k + 1]);
  }
}

/// Block holds the channels of a block.
struct Block {
  alignas(64) uint8_t channel[3][kBlock];
};

inline int32_t clipped(int32_t sum) {
  const int32_t code = sum >> kSumFraction, above = code < 0 ? 0 : code;
  return above > 255 ? 255 : above;
}

/// Returns 1 if the sum is within its error of the next code or the previous one.
inline int32_t is_doubtful(int32_t sum, int32_t error) {
  const int32_t rest = (sum + error) & ((1 << kSumFraction) - 1);
  return rest < 2 * error ? 1 : 0;
}

#if defined(__AVX2__)

/// Returns the shuffle control that puts a channel's bytes into the third of 48 bytes.
constexpr int8_t source_of(int channel, int third, int byte) {
  const int at = 16 * third + byte;
  return static_cast<int8_t>(at % 3 == channel ? at / 3 : -128);
}

struct Interleave {
  alignas(16) int8_t control[3][3][16];
};
constexpr Interleave make_interleave() {
  Interleave table{};
  for (int third = 0; third < 3; ++third)
    for (int channel = 0; channel < 3; ++channel)
      for (int byte = 0; byte < 16; ++byte)
        table.control[third][channel][byte] = source_of(channel, third, byte);
  return table;
}
constexpr Interleave kInterleave = make_interleave();

inline __m128i load(const void* from) {
  return _mm_loadu_si128(static_cast<const __m128i*>(from));
}

void interleave(const Block& block, uint8_t* rgb) {
  for (int at = 0; at < kBlock; at += 16) {
    const __m128i red = load(block.channel[0] + at), green = load(block.channel[1] + at),
                  blue = load(block.channel[2] + at);
    for (int third = 0; third < 3; ++third) {
      const auto& control = kInterleave.control[third];
      const __m128i bytes = _mm_or_si128(_mm_or_si128(_mm_shuffle_epi8(red, load(control[0])),
                                                      _mm_shuffle_epi8(green, load(control[1]))),
                                         _mm_shuffle_epi8(blue, load(control[2])));
      _mm_storeu_si128(reinterpret_cast<__m128i*>(rgb + 3 * at + 16 * third), bytes);
    }
  }
}

#elif defined(LENTICULE_NEON)

void interleave(const Block& block, uint8_t* rgb) {
  for (int at = 0; at < kBlock; at += 16) {
    const uint8x16x3_t channels = {{vld1q_u8(block.channel[0] + at),
                                    vld1q_u8(block.channel[1] + at),
                                    vld1q_u8(block.channel[2] + at)}};
    vst3q_u8(rgb + 3 * at, channels);
  }
}

#else

void interleave(const Block& block, uint8_t* rgb) {
  for (int at = 0; at < kBlock; ++at)
    for (int channel = 0; channel < 3; ++channel)
      rgb[3 * at + channel] = block.channel[channel][at];
}

#endif

void convert(const Sums& sums, const uint16_t* y, const int16_t* cb, const int16_t* cr, int count,
             uint8_t* rgb, uint8_t* doubtful) noexcept {
  const Sums s = sums;
  Block block;
  for (int begin = 0; begin < count; begin += kBlock) {
    for (int n = 0; n < kBlock; ++n) {
      const int32_t luma = s.luma * y[begin + n], blue = cb[begin + n], red = cr[begin + n];
      const int32_t r = luma + s.red_0 + s.red_cr * red;
      const int32_t g = luma + s.green_0 + s.green_cb * blue + s.green_cr * red;
      const int32_t b = luma + s.blue_0 + s.blue_cb * blue;
      block.channel[0][n] = static_cast<uint8_t>(clipped(r));
      block.channel[1][n] = static_cast<uint8_t>(clipped(g));
      block.channel[2][n] = static_cast<uint8_t>(clipped(b));
      doubtful[begin + n] = static_cast<uint8_t>(is_doubtful(r, s.error) | is_doubtful(g, s.error) |
                                                 is_doubtful(b, s.error));
    }
    interleave(block, rgb + 3 * static_cast<int64_t>(begin));
  }
}

}  // namespace

extern const PixelKernel kPixelKernel;
const PixelKernel kPixelKernel{.mix_rows = mix_rows, .spread = spread, .convert = convert};

}  // namespace lenticule::video::LENTICULE_ISA_NAMESPACE
