// SPDX-License-Identifier: Apache-2.0
// Converts rows of Y'CbCr to RGB. The conversion in 32 bits is plain loops over arrays, which the
// compiler vectorises. That in 16 bits converts pairs of pixels that share chroma samples: with
// vector instructions, even and odd pixels are in registers of their own, so that a sum of two
// chroma samples needs no shuffle.
#include "apps/lenticule-video/pixel_kernel.h"

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
#endif

#if defined(__GNUC__) && !defined(__clang__)
// gcc 12 mistakes the "undefined" registers of its own intrinsics for uninitialised variables.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"
#endif

namespace lenticule::video::LENTICULE_ISA_NAMESPACE {
namespace {

constexpr int kBlock = kPixelPadding;  ///< pixels that are converted at once

void mix_rows(const uint16_t* a, const uint16_t* b, PairWeights weights, int count,
              int16_t* out) noexcept {
  for (int k = 0; k < count; ++k)
    out[k] = static_cast<int16_t>(weights.first * a[k] + weights.second * b[k]);
}

void mix_bytes(const uint8_t* a, const uint8_t* b, PairWeights weights, int count,
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

/// Interleave holds the shuffle controls that put a channel's bytes into each third of 48 bytes.
struct Interleave {
  alignas(16) int8_t control[3][3][16];
};
/// `place_of` returns the place of a pixel's byte among those of its channel.
constexpr Interleave make_interleave(auto place_of) {
  Interleave table{};
  for (int third = 0; third < 3; ++third)
    for (int channel = 0; channel < 3; ++channel)
      for (int byte = 0; byte < 16; ++byte) {
        const int at = 16 * third + byte;
        table.control[third][channel][byte] =
            static_cast<int8_t>(at % 3 == channel ? place_of(at / 3) : -128);
      }
  return table;
}
constexpr Interleave kInterleave = make_interleave([](int pixel) { return pixel; });

inline __m128i load(const void* from) { return _mm_loadu_si128(static_cast<const __m128i*>(from)); }

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

// --- 16 bits

#if defined(__AVX2__)

#if defined(__AVX512VBMI__)
#define LENTICULE_VECTOR(name) _mm512_##name
using Words = __m512i;
#else
#define LENTICULE_VECTOR(name) _mm256_##name
using Words = __m256i;
#endif
using Bytes = Words;

inline Words load_words(const void* from) {
  Words words;
  __builtin_memcpy(&words, from, sizeof words);
  return words;
}
inline Words all(int value) { return LENTICULE_VECTOR(set1_epi16)(static_cast<int16_t>(value)); }
inline Words sum(Words a, Words b) { return LENTICULE_VECTOR(add_epi16)(a, b); }
inline Words bounded_sum(Words a, Words b) { return LENTICULE_VECTOR(adds_epi16)(a, b); }
inline Words low_product(Words a, Words b) { return LENTICULE_VECTOR(mullo_epi16)(a, b); }
inline Words product(Words a, Words b) { return LENTICULE_VECTOR(mulhrs_epi16)(a, b); }
/// Returns 128 times the bytes at even, or odd, places.
inline Words even_bytes(Bytes bytes) {
  return LENTICULE_VECTOR(srli_epi16)(LENTICULE_VECTOR(slli_epi16)(bytes, 8), 1);
}
inline Words odd_bytes(Bytes bytes) {
  return LENTICULE_VECTOR(slli_epi16)(LENTICULE_VECTOR(srli_epi16)(bytes, 8), 7);
}
inline Bytes codes_of(Words even, Words odd) {
  return LENTICULE_VECTOR(packus_epi16)(LENTICULE_VECTOR(srai_epi16)(even, kShortFraction),
                                        LENTICULE_VECTOR(srai_epi16)(odd, kShortFraction));
}

constexpr int kStep = sizeof(Bytes);  ///< pixels that are converted at once

/// Returns the place of a pixel's code: codes_of() puts the even ones of sixteen before the odd
/// ones.
constexpr int place_of(int pixel) { return pixel / 16 * 16 + pixel % 16 / 2 + pixel % 2 * 8; }

#if defined(__AVX512VBMI__)

/// PairInterleave tells, for each register of three, which code each byte is, and which bytes are
/// of the second and of the third channel.
struct PairInterleave {
  alignas(64) uint8_t from[3][64];
  uint64_t green[3], blue[3];
};
constexpr PairInterleave make_pair_interleave() {
  PairInterleave table{};
  for (int part = 0; part < 3; ++part)
    for (int byte = 0; byte < 64; ++byte) {
      const int at = 64 * part + byte;
      table.from[part][byte] = static_cast<uint8_t>(place_of(at / 3));
      table.green[part] |= uint64_t{at % 3 == 1} << byte;
      table.blue[part] |= uint64_t{at % 3 == 2} << byte;
    }
  return table;
}
constexpr PairInterleave kPairInterleave = make_pair_interleave();

/// Pixels are written past the caches where they are aligned: a picture is larger than those.
inline void store(Bytes bytes, bool aligned, uint8_t* to) {
  if (aligned)
    _mm512_stream_si512(reinterpret_cast<__m512i*>(to), bytes);
  else
    _mm512_storeu_si512(to, bytes);
}

inline void store(Bytes red, Bytes green, Bytes blue, bool aligned, uint8_t* rgb) {
  for (int part = 0; part < 3; ++part) {
    const __m512i from = _mm512_load_si512(kPairInterleave.from[part]);
    __m512i bytes = _mm512_permutexvar_epi8(from, red);
    bytes = _mm512_mask_permutexvar_epi8(bytes, kPairInterleave.green[part], from, green);
    bytes = _mm512_mask_permutexvar_epi8(bytes, kPairInterleave.blue[part], from, blue);
    store(bytes, aligned, rgb + 64 * part);
  }
}

#else

constexpr Interleave kPairInterleave = make_interleave(place_of);

inline __m256i shuffled(Bytes codes, const int8_t* control) {
  return _mm256_shuffle_epi8(codes, _mm256_broadcastsi128_si256(
                                        _mm_load_si128(reinterpret_cast<const __m128i*>(control))));
}

/// Pixels are written past the caches where they are aligned: a picture is larger than those.
inline void store(__m128i bytes, bool aligned, uint8_t* to) {
  if (aligned)
    _mm_stream_si128(reinterpret_cast<__m128i*>(to), bytes);
  else
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), bytes);
}

inline void store(Bytes red, Bytes green, Bytes blue, bool aligned, uint8_t* rgb) {
  __m256i thirds[3];
  for (int third = 0; third < 3; ++third) {
    const auto& control = kPairInterleave.control[third];
    thirds[third] =
        _mm256_or_si256(_mm256_or_si256(shuffled(red, control[0]), shuffled(green, control[1])),
                        shuffled(blue, control[2]));
  }
  for (int third = 0; third < 3; ++third)
    store(_mm256_castsi256_si128(thirds[third]), aligned, rgb + 16 * third);
  for (int third = 0; third < 3; ++third)
    store(_mm256_extracti128_si256(thirds[third], 1), aligned, rgb + 48 + 16 * third);
}

#endif

/// Pairs holds values of the even and of the odd pixels.
struct Pairs {
  Words even, odd;
};

/// Weights holds PairWeights in all words.
struct Weights {
  explicit Weights(PairWeights weights) : first(all(weights.first)), second(all(weights.second)) {}
  Words first, second;
};

inline Words weighted(const Weights& weights, Words a, Words b) {
  return sum(low_product(a, weights.first), low_product(b, weights.second)) ^ all(1 << 15);
}

inline Pairs chroma_of(const Weights& even, const Weights& odd, const int16_t* samples) {
  const Words here = load_words(samples);
  return {weighted(even, load_words(samples - 1), here),
          weighted(odd, here, load_words(samples + 1))};
}

inline Pairs products(const Pairs& values, Words factor) {
  return {product(values.even, factor), product(values.odd, factor)};
}

inline Bytes codes_of(const Pairs& luma, const Pairs& chroma) {
  return codes_of(bounded_sum(luma.even, chroma.even), bounded_sum(luma.odd, chroma.odd));
}

void convert_short(const ShortSums& sums, const uint8_t* y, const int16_t* cb, const int16_t* cr,
                   int count, uint8_t* rgb) noexcept {
  const Weights even(sums.even), odd(sums.odd);
  const Words luma_factor = all(sums.luma), constant = all(sums.constant);
  const Words red_cr = all(sums.red_cr), green_cb = all(sums.green_cb),
              green_cr = all(sums.green_cr), blue_cb = all(sums.blue_cb);
  const bool aligned = reinterpret_cast<uintptr_t>(rgb) % sizeof(Bytes) == 0;
  for (int begin = 0; begin < count; begin += kStep) {
    const Bytes bytes = load_words(y + begin);
    const Pairs scaled = products({even_bytes(bytes), odd_bytes(bytes)}, luma_factor);
    const Pairs luma{sum(scaled.even, constant), sum(scaled.odd, constant)};
    const Pairs blue = chroma_of(even, odd, cb + begin / 2);
    const Pairs red = chroma_of(even, odd, cr + begin / 2);
    const Pairs by_blue = products(blue, green_cb), by_red = products(red, green_cr);
    const Pairs green{sum(by_blue.even, by_red.even), sum(by_blue.odd, by_red.odd)};
    store(codes_of(luma, products(red, red_cr)), codes_of(luma, green),
          codes_of(luma, products(blue, blue_cb)), aligned, rgb + 3 * static_cast<int64_t>(begin));
  }
  _mm_sfence();
}

#else

constexpr int kStep = kBlock;  ///< pixels that are converted at once

inline int product(int a, int b) { return (a * b + (1 << 14)) >> 15; }

inline uint8_t code_of(int sum) {
  const int code = sum >> kShortFraction, above = code < 0 ? 0 : code;
  return static_cast<uint8_t>(above > 255 ? 255 : above);
}

/// Writes the distance from grey of a block's pixels.
void spread_short(const ShortSums& sums, const int16_t* samples, int16_t* out) {
  const PairWeights even = sums.even, odd = sums.odd;
  for (int k = 0; k < kStep / 2; ++k) {
    const int first = even.first * samples[k - 1] + even.second * samples[k];
    const int second = odd.first * samples[k] + odd.second * samples[k + 1];
    out[2 * k] = static_cast<int16_t>(first - (1 << 15));
    out[2 * k + 1] = static_cast<int16_t>(second - (1 << 15));
  }
}

void convert_short(const ShortSums& sums, const uint8_t* y, const int16_t* cb, const int16_t* cr,
                   int count, uint8_t* rgb) noexcept {
  const ShortSums s = sums;
  Block block;
  int16_t blue[kStep], red[kStep];
  for (int begin = 0; begin < count; begin += kStep) {
    spread_short(s, cb + begin / 2, blue);
    spread_short(s, cr + begin / 2, red);
    for (int n = 0; n < kStep; ++n) {
      const int luma = product(y[begin + n] << 7, s.luma) + s.constant;
      block.channel[0][n] = code_of(luma + product(red[n], s.red_cr));
      block.channel[1][n] =
          code_of(luma + product(blue[n], s.green_cb) + product(red[n], s.green_cr));
      block.channel[2][n] = code_of(luma + product(blue[n], s.blue_cb));
    }
    interleave(block, rgb + 3 * static_cast<int64_t>(begin));
  }
}

#endif

static_assert(kPixelPadding % kStep == 0);

}  // namespace

extern const PixelKernel kPixelKernel;
const PixelKernel kPixelKernel{.mix_rows = mix_rows,
                               .mix_bytes = mix_bytes,
                               .spread = spread,
                               .convert = convert,
                               .convert_short = convert_short};

}  // namespace lenticule::video::LENTICULE_ISA_NAMESPACE
