// SPDX-License-Identifier: Apache-2.0
#include "frames/sequence/band_codec.h"

#define ZSTD_STATIC_LINKING_ONLY  // for literals that are compressed although matches are skipped
#include <zstd.h>

#include <cstring>
#include <new>

#include "base/error.h"
#include "frames/aligned_bytes.h"
#include "frames/sequence/little_endian.h"
#include "frames/sequence/predictor_kernel.h"

namespace lenticule::frames {
namespace {

constexpr size_t kPredictorHeaderBytes = 4;
constexpr size_t kStreamHeaderBytes = 4;
constexpr size_t kMaskBytes = 4;
/// Shorter matches cost the decoder more than they save here: docs/content/formats.md has the
/// figures.
constexpr int kMinMatch = 7;
/// Skips most places at which a match could begin, so that nearly all bytes are Huffman codes.
constexpr int kFewMatches = 100'000;
/// Part by which a stream of Huffman codes, which decode faster, may be larger than one with
/// matches.
constexpr size_t kPartForSpeed = 16;
/// Smaller bands stay in the caches.
constexpr size_t kLeastStreamed = size_t{1} << 18;

struct FreeCompressor {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};
struct FreeDecompressor {
  void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};
using Compressor = std::unique_ptr<ZSTD_CCtx, FreeCompressor>;
using Decompressor = std::unique_ptr<ZSTD_DCtx, FreeDecompressor>;

Compressor make_compressor() {
  Compressor context(ZSTD_createCCtx());
  if (!context) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, 1);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_strategy, ZSTD_fast);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_minMatch, kMinMatch);
  return context;
}

/// Makes a compressor that looks for few matches. A library that does not know the setting stores
/// such streams uncompressed, and the other compressor's are smaller.
Compressor make_coder() {
  Compressor context = make_compressor();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_targetLength, kFewMatches);
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_literalCompressionMode, ZSTD_ps_enable);
  return context;
}

Decompressor make_decompressor() {
  Decompressor context(ZSTD_createDCtx());
  if (!context) throw std::bad_alloc();
  return context;
}

size_t blocks_of(size_t band_bytes) {
  return (band_bytes + kBlockBytes - 1) / kBlockBytes;
}

}  // namespace

struct BandEncoder::State {
  State(size_t max_band_bytes, const PredictorKernel& functions)
      : kernel(functions),
        compressor(make_compressor()),
        coder(make_coder()),
        modes(blocks_of(max_band_bytes)),
        masks(blocks_of(max_band_bytes) * kMaskBytes),
        values(blocks_of(max_band_bytes) * kBlockBytes),
        packed(ZSTD_compressBound(values.size())),
        coded(packed.size()) {}

  /// Compresses `bytes`. Returns the result, or nothing if compression would save none.
  static std::span<const uint8_t> compress(ZSTD_CCtx* context, std::span<const uint8_t> bytes,
                                           std::vector<uint8_t>& to) {
    const size_t size = ZSTD_compress2(context, to.data(), to.size(), bytes.data(), bytes.size());
    if (ZSTD_isError(size) != 0 || size >= bytes.size()) return {};
    return std::span<const uint8_t>(to).first(size);
  }

  /// Returns the smaller result, or the one that decodes faster if it is little larger.
  std::span<const uint8_t> compress_for_speed(std::span<const uint8_t> bytes) {
    const std::span<const uint8_t> small = compress(compressor.get(), bytes, packed);
    const std::span<const uint8_t> fast = compress(coder.get(), bytes, coded);
    const bool is_small = fast.size() <= small.size() + small.size() / kPartForSpeed;
    return small.empty() || (is_small && !fast.empty()) ? fast : small;
  }

  void append_stream(std::span<const uint8_t> bytes, std::vector<uint8_t>& payload) {
    std::span<const uint8_t> stored;
    if (!bytes.empty()) stored = compress_for_speed(bytes);
    if (stored.empty()) stored = bytes;
    append_u32(payload, static_cast<uint32_t>(stored.size()));
    payload.insert(payload.end(), stored.begin(), stored.end());
  }

  const PredictorKernel& kernel;
  Compressor compressor;
  Compressor coder;
  std::vector<uint8_t> modes;
  std::vector<uint8_t> masks;
  std::vector<uint8_t> values;
  std::vector<uint8_t> packed;
  std::vector<uint8_t> coded;
  std::vector<uint8_t> plain;  ///< the other codec's payload, while two are compared
};

BandEncoder::BandEncoder(size_t max_band_bytes, Isa isa)
    : state_(std::make_unique<State>(max_band_bytes, predictor_kernel(isa))) {}
BandEncoder::~BandEncoder() = default;
BandEncoder::BandEncoder(BandEncoder&&) noexcept = default;
BandEncoder& BandEncoder::operator=(BandEncoder&&) noexcept = default;

BandCodec BandEncoder::encode(std::span<const uint8_t> band, const PredictorTable& predictors,
                              std::vector<uint8_t>& payload) {
  const bool predicted = encode_as(BandCodec::Predicted, band, predictors, payload);
  if (predicted && payload.size() < band.size() / 2) return BandCodec::Predicted;
  // Unpredictable data may still repeat itself.
  const bool zstd = encode_as(BandCodec::Zstd, band, predictors, state_->plain);
  if (zstd && (!predicted || state_->plain.size() < payload.size())) {
    std::swap(payload, state_->plain);
    return BandCodec::Zstd;
  }
  if (predicted) return BandCodec::Predicted;
  payload.assign(band.begin(), band.end());
  return BandCodec::Raw;
}

bool BandEncoder::encode_as(BandCodec codec, std::span<const uint8_t> band,
                            const PredictorTable& predictors, std::vector<uint8_t>& payload) {
  State& s = *state_;
  LENTICULE_CHECK(blocks_of(band.size()) <= s.modes.size());
  payload.clear();
  if (codec == BandCodec::Raw) {
    payload.assign(band.begin(), band.end());
  } else if (codec == BandCodec::Zstd) {
    const std::span<const uint8_t> packed = State::compress(s.compressor.get(), band, s.packed);
    if (packed.empty()) return false;
    payload.assign(packed.begin(), packed.end());
  } else {
    PredictorOutput out{
        .modes = s.modes.data(), .masks = s.masks.data(), .values = s.values.data()};
    s.kernel.encode_blocks(predictors, band.data(), band.size(), out);
    append_u32(payload, static_cast<uint32_t>(predictors.count));
    for (int predictor = 1; predictor <= predictors.count; ++predictor)
      append_u32(payload, predictors.distance[predictor]);
    s.append_stream({s.modes.data(), blocks_of(band.size())}, payload);
    s.append_stream({s.masks.data(), out.mask_bytes}, payload);
    s.append_stream({s.values.data(), out.value_bytes}, payload);
  }
  return payload.size() <= band.size();
}

struct BandDecoder::State {
  State(size_t max_band_bytes, const PredictorKernel& functions)
      : kernel(functions),
        decompressor(make_decompressor()),
        modes(blocks_of(max_band_bytes)),
        masks(blocks_of(max_band_bytes) * kMaskBytes + kMaskPadding),
        values(max_band_bytes + kValuePadding),
        window(kernel.streams && max_band_bytes >= kLeastStreamed ? max_band_bytes : 0) {}

  /// Returns where predicted blocks of a band are decoded to.
  [[nodiscard]] PredictorTarget target_of(std::span<uint8_t> band) noexcept {
    const bool aligned = reinterpret_cast<uintptr_t>(band.data()) % kBlockBytes == 0;
    const bool streams = aligned && band.size() >= kLeastStreamed && window.size() >= band.size();
    return {.out = band.data(), .window = streams ? window.data() : band.data()};
  }

  [[nodiscard]] bool decompress(std::span<const uint8_t> from, std::span<uint8_t> to) noexcept {
    const size_t size =
        ZSTD_decompressDCtx(decompressor.get(), to.data(), to.size(), from.data(), from.size());
    return ZSTD_isError(size) == 0 && size == to.size();
  }

  /// Takes the next stream from `payload`; a stream as long as its content is stored uncompressed.
  [[nodiscard]] bool take_stream(std::span<const uint8_t>& payload,
                                 std::span<uint8_t> to) noexcept {
    if (payload.size() < kStreamHeaderBytes) return false;
    const size_t stored = load_u32(payload.data());
    payload = payload.subspan(kStreamHeaderBytes);
    if (stored > payload.size() || stored > to.size()) return false;
    const std::span<const uint8_t> from = payload.first(stored);
    payload = payload.subspan(stored);
    if (stored < to.size()) return decompress(from, to);
    if (!to.empty()) std::memcpy(to.data(), from.data(), stored);
    return true;
  }

  [[nodiscard]] bool take_predictors(std::span<const uint8_t>& payload,
                                     PredictorTable& predictors) noexcept {
    if (payload.size() < kPredictorHeaderBytes) return false;
    const uint32_t count = load_u32(payload.data());
    payload = payload.subspan(kPredictorHeaderBytes);
    if (count > kMaxPredictors || payload.size() < count * sizeof(uint32_t)) return false;
    predictors.count = static_cast<int>(count);
    for (uint32_t predictor = 1; predictor <= count; ++predictor) {
      predictors.distance[predictor] =
          load_u32(payload.data() + (predictor - 1) * sizeof(uint32_t));
      if (predictors.distance[predictor] < kBlockBytes) return false;
    }
    payload = payload.subspan(count * sizeof(uint32_t));
    return true;
  }

  [[nodiscard]] bool decode_predicted(std::span<const uint8_t> payload,
                                      std::span<uint8_t> band) noexcept {
    PredictorTable predictors;
    const std::span<uint8_t> mode_bytes(modes.data(), blocks_of(band.size()));
    if (!take_predictors(payload, predictors) || !take_stream(payload, mode_bytes)) return false;
    const size_t masked = kernel.count_residuals(mode_bytes.data(), mode_bytes.size());
    const std::span<uint8_t> mask_bytes(masks.data(), masked * kMaskBytes);
    if (!take_stream(payload, mask_bytes)) return false;
    const size_t value_count = kernel.count_bits(mask_bytes.data(), mask_bytes.size());
    if (value_count > band.size()) return false;
    if (!take_stream(payload, {values.data(), value_count}) || !payload.empty()) return false;
    return kernel.decode_blocks(predictors,
                                {.modes = modes.data(),
                                 .masks = masks.data(),
                                 .values = values.data(),
                                 .value_count = value_count},
                                target_of(band), band.size());
  }

  const PredictorKernel& kernel;
  Decompressor decompressor;
  std::vector<uint8_t> modes;
  std::vector<uint8_t> masks;
  std::vector<uint8_t> values;
  AlignedBytes window;  ///< blocks of a band that is written past the caches
};

BandDecoder::BandDecoder(size_t max_band_bytes, Isa isa)
    : state_(std::make_unique<State>(max_band_bytes, predictor_kernel(isa))) {}
BandDecoder::~BandDecoder() = default;
BandDecoder::BandDecoder(BandDecoder&&) noexcept = default;
BandDecoder& BandDecoder::operator=(BandDecoder&&) noexcept = default;

bool BandDecoder::decode(BandCodec codec, std::span<const uint8_t> payload,
                         std::span<uint8_t> band) noexcept {
  if (blocks_of(band.size()) > state_->modes.size()) return false;
  switch (codec) {
    case BandCodec::Raw:
      if (payload.size() != band.size()) return false;
      if (!band.empty()) std::memcpy(band.data(), payload.data(), band.size());
      return true;
    case BandCodec::Zstd:
      return state_->decompress(payload, band);
    case BandCodec::Predicted:
      return state_->decode_predicted(payload, band);
  }
  return false;
}

}  // namespace lenticule::frames
