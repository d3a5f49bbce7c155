// SPDX-License-Identifier: Apache-2.0
// Predicts blocks of 32 bytes from earlier data of the same band, and codes their residuals.
#include "frames/sequence/predictor_kernel.h"

#if defined(__AVX2__)
#include <immintrin.h>
#elif defined(LENTICULE_NEON)
#include <arm_neon.h>
#endif

namespace lenticule::frames::LENTICULE_ISA_NAMESPACE {
namespace {

constexpr int kNonZeroCost = 4;  // a bit of the mask becomes likely, and a value is stored
constexpr int kLargeCost = 1;    // cost beyond +-3: such values are rarer for the entropy coder
constexpr uint8_t kPredictorMask = 15;
constexpr int kNoCost = 1 << 20;

const uint8_t kZeros[kBlockBytes] = {};

#if (defined(__AVX2__) && !defined(__AVX512VBMI2__)) || defined(LENTICULE_NEON)

/// SpreadTable maps a byte of a mask to the positions of its values: shuffle control for eight
/// bytes.
struct SpreadTable {
  alignas(8) uint8_t control[256][8];
};

constexpr SpreadTable make_spread_table() {
  SpreadTable table{};
  for (int mask = 0; mask < 256; ++mask) {
    uint8_t next = 0;
    for (int bit = 0; bit < 8; ++bit) {
      const bool set = (mask >> bit & 1) != 0;
      table.control[mask][bit] = set ? next : uint8_t{0x80};
      if (set) ++next;
    }
  }
  return table;
}

constexpr SpreadTable kSpread = make_spread_table();

#endif

#if defined(__AVX2__)

struct Block {
  __m256i bytes;
};

Block load(const uint8_t* from) noexcept {
  return {_mm256_loadu_si256(reinterpret_cast<const __m256i*>(from))};
}

void store(Block block, uint8_t* to) noexcept {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), block.bytes);
}

/// Stores past the caches.
void stream(Block block, uint8_t* to) noexcept {
  _mm256_stream_si256(reinterpret_cast<__m256i*>(to), block.bytes);
}
void end_streaming() noexcept { _mm_sfence(); }
constexpr bool kStreams = true;

#if defined(__AVX512VBMI2__)

/// Adds the next values to the bytes whose bit is set in the mask.
Block add_values(Block block, uint32_t mask, const uint8_t* values) noexcept {
  const __m256i packed = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(values));
  return {_mm256_add_epi8(block.bytes, _mm256_maskz_expand_epi8(mask, packed))};
}

#else

__m128i spread_eight(uint32_t mask, const uint8_t*& values) noexcept {
  const __m128i packed = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(values));
  const __m128i control =
      _mm_loadl_epi64(reinterpret_cast<const __m128i*>(kSpread.control[mask & 255]));
  values += __builtin_popcount(mask & 255);
  return _mm_shuffle_epi8(packed, control);
}

/// Adds the next values to the bytes whose bit is set in the mask.
Block add_values(Block block, uint32_t mask, const uint8_t* values) noexcept {
  const __m128i a = spread_eight(mask, values);
  const __m128i b = spread_eight(mask >> 8, values);
  const __m128i c = spread_eight(mask >> 16, values);
  const __m128i d = spread_eight(mask >> 24, values);
  const __m256i all = _mm256_set_m128i(_mm_unpacklo_epi64(c, d), _mm_unpacklo_epi64(a, b));
  return {_mm256_add_epi8(block.bytes, all)};
}

#endif

/// Returns the bytes nearest to `from` that are at most `error` away from those of `block`.
Block nearest_within(Block block, Block from, uint8_t error) noexcept {
  const __m256i step = _mm256_set1_epi8(static_cast<char>(error));
  const __m256i least = _mm256_subs_epu8(block.bytes, step);
  const __m256i most = _mm256_adds_epu8(block.bytes, step);
  return {_mm256_min_epu8(_mm256_max_epu8(from.bytes, least), most)};
}

struct Difference {
  uint32_t non_zero;
  uint32_t large;
};

Difference difference(Block block, Block from) noexcept {
  const __m256i rest = _mm256_sub_epi8(block.bytes, from.bytes);
  const __m256i zero = _mm256_setzero_si256();
  const __m256i moved = _mm256_add_epi8(rest, _mm256_set1_epi8(3));
  const __m256i beyond = _mm256_subs_epu8(moved, _mm256_set1_epi8(6));
  return {~static_cast<uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(rest, zero))),
          ~static_cast<uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(beyond, zero)))};
}

#elif defined(LENTICULE_NEON)

struct Block {
  uint8x16_t low, high;
};

Block load(const uint8_t* from) noexcept { return {vld1q_u8(from), vld1q_u8(from + 16)}; }

void store(Block block, uint8_t* to) noexcept {
  vst1q_u8(to, block.low);
  vst1q_u8(to + 16, block.high);
}

uint8x8_t spread_eight(uint32_t mask, const uint8_t*& values) noexcept {
  const uint8x8_t packed = vld1_u8(values);
  values += __builtin_popcount(mask & 255);
  return vtbl1_u8(packed, vld1_u8(kSpread.control[mask & 255]));
}

/// Adds the next values to the bytes whose bit is set in the mask.
Block add_values(Block block, uint32_t mask, const uint8_t* values) noexcept {
  const uint8x8_t a = spread_eight(mask, values);
  const uint8x8_t b = spread_eight(mask >> 8, values);
  const uint8x8_t c = spread_eight(mask >> 16, values);
  const uint8x8_t d = spread_eight(mask >> 24, values);
  return {vaddq_u8(block.low, vcombine_u8(a, b)), vaddq_u8(block.high, vcombine_u8(c, d))};
}

Block nearest_within(Block block, Block from, uint8_t error) noexcept {
  const uint8x16_t step = vdupq_n_u8(error);
  const auto half = [&](uint8x16_t b, uint8x16_t f) {
    return vminq_u8(vmaxq_u8(f, vqsubq_u8(b, step)), vqaddq_u8(b, step));
  };
  return {half(block.low, from.low), half(block.high, from.high)};
}

struct Difference {
  uint32_t non_zero;
  uint32_t large;
};

/// Returns bit n of 32 bytes that are 0 or 255 each: keeps one bit of each byte and adds eight
/// neighbours.
uint32_t bits_of_bytes(uint8x16_t low, uint8x16_t high) noexcept {
  const uint8x16_t bit = vreinterpretq_u8_u64(vdupq_n_u64(0x8040201008040201));
  uint8x16_t sums = vpaddq_u8(vandq_u8(low, bit), vandq_u8(high, bit));
  sums = vpaddq_u8(sums, sums);
  sums = vpaddq_u8(sums, sums);
  return vgetq_lane_u32(vreinterpretq_u32_u8(sums), 0);
}

Difference difference(Block block, Block from) noexcept {
  const uint8x16_t low = vsubq_u8(block.low, from.low), high = vsubq_u8(block.high, from.high);
  const uint8x16_t three = vdupq_n_u8(3), six = vdupq_n_u8(6);
  return {bits_of_bytes(vtstq_u8(low, low), vtstq_u8(high, high)),
          bits_of_bytes(vcgtq_u8(vaddq_u8(low, three), six), vcgtq_u8(vaddq_u8(high, three), six))};
}

#else

struct Block {
  uint8_t bytes[kBlockBytes];
};

Block load(const uint8_t* from) noexcept {
  Block block;
  __builtin_memcpy(block.bytes, from, kBlockBytes);
  return block;
}

void store(const Block& block, uint8_t* to) noexcept {
  __builtin_memcpy(to, block.bytes, kBlockBytes);
}

Block add_values(Block block, uint32_t mask, const uint8_t* values) noexcept {
  for (; mask != 0; mask &= mask - 1) {
    uint8_t& byte = block.bytes[__builtin_ctz(mask)];
    byte = static_cast<uint8_t>(byte + *values++);
  }
  return block;
}

Block nearest_within(const Block& block, const Block& from, uint8_t error) noexcept {
  Block result;
  for (size_t i = 0; i < kBlockBytes; ++i) {
    const int least = block.bytes[i] - error, most = block.bytes[i] + error;
    const int value = from.bytes[i];
    result.bytes[i] = static_cast<uint8_t>(value < least ? least : value > most ? most : value);
  }
  return result;
}

struct Difference {
  uint32_t non_zero;
  uint32_t large;
};

Difference difference(const Block& block, const Block& from) noexcept {
  Difference result{0, 0};
  for (size_t i = 0; i < kBlockBytes; ++i) {
    const auto rest = static_cast<uint8_t>(block.bytes[i] - from.bytes[i]);
    result.non_zero |= static_cast<uint32_t>(rest != 0) << i;
    result.large |= static_cast<uint32_t>(static_cast<uint8_t>(rest + 3) > 6) << i;
  }
  return result;
}

#endif

int cost_of(Difference d, uint32_t counted) noexcept {
  return kNonZeroCost * __builtin_popcount(d.non_zero & counted) +
         kLargeCost * __builtin_popcount(d.large & counted);
}

uint32_t load_mask(const uint8_t* from) noexcept {
  return static_cast<uint32_t>(from[0]) | static_cast<uint32_t>(from[1]) << 8 |
         static_cast<uint32_t>(from[2]) << 16 | static_cast<uint32_t>(from[3]) << 24;
}

void store_mask(uint32_t mask, uint8_t* to) noexcept {
  for (int i = 0; i < 4; ++i) to[i] = static_cast<uint8_t>(mask >> 8 * i);
}

/// Returns the mask bits of a block of which only `bytes` bytes exist.
uint32_t bits_of(size_t bytes) noexcept {
  return bytes >= kBlockBytes ? ~uint32_t{0} : (uint32_t{1} << bytes) - 1;
}

struct Choice {
  int predictor = 0;
  int cost = kNoCost;
  uint32_t non_zero = 0;
};

Choice choose_predictor(const PredictorTable& predictors, const uint8_t* window, size_t start,
                        const Block& block, uint8_t max_error, uint32_t counted) noexcept {
  Choice best;
  for (int predictor = 1; predictor <= predictors.count + 1; ++predictor) {
    const int index = predictor > predictors.count
                          ? 0
                          : predictor;  // "zero" comes last, because it is seldom the cheapest
    const size_t distance = predictors.distance[index];
    if (distance > start) continue;
    const Block from = load(index == 0 ? kZeros : window + start - distance);
    const Block wanted = max_error == 0 ? block : nearest_within(block, from, max_error);
    const Difference d = difference(wanted, from);
    const int cost = cost_of(d, counted);
    if (cost < best.cost) best = {index, cost, d.non_zero & counted};
    if (best.cost == 0) break;
  }
  return best;
}

void write_block(const Choice& choice, const uint8_t* block, const uint8_t* from,
                 PredictorOutput& out) noexcept {
  *out.modes++ = static_cast<uint8_t>(choice.predictor | (choice.non_zero != 0 ? kHasResidual : 0));
  if (choice.non_zero == 0) return;
  store_mask(choice.non_zero, out.masks + out.mask_bytes);
  out.mask_bytes += 4;
  for (uint32_t mask = choice.non_zero; mask != 0; mask &= mask - 1) {
    const int i = __builtin_ctz(mask);
    out.values[out.value_bytes++] = static_cast<uint8_t>(block[i] - from[i]);
  }
}

#if !defined(__AVX2__)

void stream(const Block& block, uint8_t* to) noexcept { store(block, to); }
void end_streaming() noexcept {}
constexpr bool kStreams = false;

#endif

constexpr size_t kGroup = 8;  ///< number of blocks after which a run is looked for

/// Returns true if the next kGroup blocks are copies from the same distance: most of a static
/// picture.
bool is_run(const uint8_t* modes) noexcept {
  static_assert(kGroup == sizeof(uint64_t));
  uint64_t eight = 0;
  __builtin_memcpy(&eight, modes, sizeof eight);
  const uint8_t mode = modes[0];
  return mode != 0 && mode <= kPredictorMask && eight == mode * uint64_t{0x0101010101010101};
}

/// Target takes the blocks of a band: into the window alone, or also past the caches.
template <bool kStreamed>
struct Target {
  uint8_t* out;
  uint8_t* window;

  void take(const Block& block, size_t start) const noexcept {
    store(block, window + start);
    if constexpr (kStreamed) stream(block, out + start);
  }
};

template <bool kStreamed>
void copy_run(size_t distance, const Target<kStreamed>& to, size_t start) noexcept {
  const size_t end = start + kGroup * kBlockBytes;
  for (; start < end; start += kBlockBytes) to.take(load(to.window + start - distance), start);
}

/// BlockDecoder decodes the blocks of a band one after the other. No branch depends on whether a
/// block has residuals, which is hard to predict: a block without has an empty mask.
template <bool kStreamed>
class BlockDecoder {
 public:
  BlockDecoder(const PredictorTable& predictors, const PredictorStreams& in,
               const Target<kStreamed>& to) noexcept
      : modes_(in.modes),
        masks_(in.masks),
        values_(in.values),
        values_end_(in.values + in.value_count),
        to_(to) {
    for (int predictor = 0; predictor <= kPredictorMask; ++predictor)
      distance_[predictor] =
          predictor <= predictors.count ? predictors.distance[predictor] : kOutOfReach;
  }

  /// Decodes a run if one begins at `start`; returns false if there is none.
  [[nodiscard]] bool decode_run(size_t start) noexcept {
    const uint8_t* const modes = modes_ + start / kBlockBytes;
    if (!is_run(modes)) return false;
    const size_t distance = distance_[modes[0]];
    if (distance > start) return false;
    copy_run(distance, to_, start);
    return true;
  }

  /// Computes the block at `start`, of which the bytes in `existing` exist; returns false for wrong
  /// input.
  [[nodiscard]] bool decode(size_t start, uint32_t existing, Block& block) noexcept {
    const uint8_t mode = modes_[start / kBlockBytes];
    const int predictor = mode & kPredictorMask;
    const size_t distance = distance_[predictor];
    if (mode > (kPredictorMask | kHasResidual) || distance > start) return false;
    const uint32_t has_residual = mode / kHasResidual;
    const uint32_t mask = load_mask(masks_) & (0 - has_residual);
    const int count = __builtin_popcount(mask);
    if (count > values_end_ - values_ || (mask & ~existing) != 0) return false;
    block =
        add_values(load(predictor == 0 ? kZeros : to_.window + start - distance), mask, values_);
    masks_ += 4 * has_residual;
    values_ += count;
    return true;
  }

  [[nodiscard]] bool is_complete() const noexcept { return values_ == values_end_; }

 private:
  static constexpr uint32_t kOutOfReach = ~uint32_t{0};

  uint32_t distance_[kPredictorMask + 1];
  const uint8_t* const modes_;
  const uint8_t* masks_;
  const uint8_t* values_;
  const uint8_t* const values_end_;
  const Target<kStreamed> to_;
};

template <bool kStreamed>
bool decode_band(const PredictorTable& predictors, const PredictorStreams& in,
                 const Target<kStreamed>& to, size_t bytes) noexcept {
  constexpr size_t kGroupBytes = kGroup * kBlockBytes;
  BlockDecoder<kStreamed> decoder(predictors, in, to);
  Block block;
  size_t start = 0;
  const auto decode_whole = [&]() noexcept {
    if (!decoder.decode(start, ~uint32_t{0}, block)) return false;
    to.take(block, start);
    start += kBlockBytes;
    return true;
  };
  while (bytes - start >= kGroupBytes) {
    if (decoder.decode_run(start)) {
      start += kGroupBytes;
      continue;
    }
    for (size_t n = 0; n < kGroup; ++n)
      if (!decode_whole()) return false;
  }
  while (bytes - start >= kBlockBytes)
    if (!decode_whole()) return false;
  if (start < bytes) {
    if (!decoder.decode(start, bits_of(bytes - start), block)) return false;
    uint8_t whole[kBlockBytes];
    store(block, whole);
    __builtin_memcpy(to.out + start, whole, bytes - start);
  }
  return decoder.is_complete();
}

bool decode_blocks(const PredictorTable& predictors, const PredictorStreams& in,
                   const PredictorTarget& to, size_t bytes) noexcept {
  if (to.window == to.out)
    return decode_band<false>(predictors, in, {.out = to.out, .window = to.out}, bytes);
  const bool whole = decode_band<true>(predictors, in, {.out = to.out, .window = to.window}, bytes);
  end_streaming();
  return whole;
}

/// Computes the block that the decoder will have: differences from the prediction that are beyond
/// `max_error` are rounded to multiples of 2 max_error + 1, so that few different residuals remain.
void round_block(const Choice& choice, const uint8_t* block, const uint8_t* from, int max_error,
                 uint8_t* to) noexcept {
  const int step = 2 * max_error + 1;
  const int reciprocal = (1 << 16) / step + 1;
  __builtin_memcpy(to, from, kBlockBytes);
  for (uint32_t mask = choice.non_zero; mask != 0; mask &= mask - 1) {
    const int i = __builtin_ctz(mask);
    const int rest = block[i] - from[i];
    const int steps = ((rest < 0 ? -rest : rest) + max_error) * reciprocal >> 16;
    const int value = from[i] + (rest < 0 ? -steps : steps) * step;
    to[i] = static_cast<uint8_t>(value < 0 ? 0 : value > 255 ? 255 : value);
  }
}

void encode_blocks(const PredictorTable& predictors, const PredictorSource& source,
                   PredictorOutput& out) noexcept {
  const uint8_t* const window = source.max_error == 0 ? source.band : source.window;
  for (size_t start = 0; start < source.bytes; start += kBlockBytes) {
    const size_t left = source.bytes - start;
    uint8_t partial[kBlockBytes] = {};
    const uint8_t* block = source.band + start;
    if (left < kBlockBytes) {
      __builtin_memcpy(partial, block, left);
      block = partial;
    }
    const Choice choice =
        choose_predictor(predictors, window, start, load(block), source.max_error, bits_of(left));
    const uint8_t* from =
        choice.predictor == 0 ? kZeros : window + start - predictors.distance[choice.predictor];
    if (source.max_error > 0) {
      round_block(choice, block, from, source.max_error, source.window + start);
      block = source.window + start;
    }
    write_block(choice, block, from, out);
  }
}

int predictor_cost(const uint8_t* block, const uint8_t* from) noexcept {
  return cost_of(difference(load(block), load(from)), ~uint32_t{0});
}

size_t count_residuals(const uint8_t* modes, size_t count) noexcept {
  size_t residuals = 0;
  for (size_t i = 0; i < count; ++i) residuals += (modes[i] & kHasResidual) != 0 ? 1 : 0;
  return residuals;
}

size_t count_bits(const uint8_t* masks, size_t bytes) noexcept {
  size_t bits = 0;
  for (size_t i = 0; i + 4 <= bytes; i += 4)
    bits += static_cast<size_t>(__builtin_popcount(load_mask(masks + i)));
  return bits;
}

}  // namespace

const PredictorKernel kPredictorKernel{.decode_blocks = decode_blocks,
                                       .encode_blocks = encode_blocks,
                                       .predictor_cost = predictor_cost,
                                       .count_residuals = count_residuals,
                                       .count_bits = count_bits,
                                       .streams = kStreams};

}  // namespace lenticule::frames::LENTICULE_ISA_NAMESPACE
