// SPDX-License-Identifier: Apache-2.0
#define ZSTD_STATIC_LINKING_ONLY  // for literals that are compressed although matches are skipped
#include "frames/sequence/band_codec.h"

#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

#include "base/error.h"
#include "base/owned.h"
#include "frames/sequence/sequence_format.h"

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

using Compressor = Owned<ZSTD_CCtx, ZSTD_freeCCtx>;
using Decompressor = Owned<ZSTD_DCtx, ZSTD_freeDCtx>;

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

size_t blocks_of(size_t band_bytes) { return (band_bytes + kBlockBytes - 1) / kBlockBytes; }

constexpr size_t kSamples = 8192;
constexpr int kMaxRowsUp = 8;
constexpr int kMaxPixelsAside = 16;
constexpr int kMaxPixelsLeft = 32;    // distance within the row
constexpr uint8_t kNothingYet = 160;  // more than any block costs without prediction

/// Returns candidate distances of whole pixels, so that red is predicted from red.
std::vector<uint32_t> candidates(const FrameGeometry& geometry, int band_rows) {
  const auto pixel = static_cast<int64_t>(bytes_per_pixel(geometry.format));
  const auto row = static_cast<int64_t>(geometry.row_bytes());
  std::vector<uint32_t> distances;
  const auto add = [&](int64_t distance) {
    if (distance >= static_cast<int64_t>(kBlockBytes))
      distances.push_back(static_cast<uint32_t>(distance));
  };
  for (int left = 1; left <= std::min(kMaxPixelsLeft, geometry.width - 1); ++left)
    add(left * pixel);
  const int aside = std::min(kMaxPixelsAside, geometry.width - 1);
  for (int up = 1; up <= std::min(kMaxRowsUp, band_rows - 1); ++up) {
    for (int left = -aside; left <= aside; ++left) add(up * row + left * pixel);
  }
  std::sort(distances.begin(), distances.end());
  distances.erase(std::unique(distances.begin(), distances.end()), distances.end());
  return distances;
}

/// Returns starts of whole blocks, spread over the frame, at which every candidate is inside its
/// band.
std::vector<size_t> sample_blocks(const FrameGeometry& geometry, int band_rows) {
  const size_t row = geometry.row_bytes();
  const size_t band = row * static_cast<size_t>(band_rows);
  const size_t reach = std::min(row * kMaxRowsUp + row / 2, band / 2);
  const size_t blocks = geometry.frame_bytes() / kBlockBytes;
  const size_t step =
      std::max<size_t>(blocks / kSamples, 1) | 1;  // odd, so that all columns are sampled
  std::vector<size_t> starts;
  for (size_t block = 0; block < blocks; block += step) {
    const size_t start = block * kBlockBytes;
    if (start % band >= reach) starts.push_back(start);
  }
  return starts;
}

/// Returns costs[c * starts.size() + s]: the cost of sample s predicted from candidate c.
std::vector<uint8_t> measure(const FrameView& frame, const std::vector<uint32_t>& distances,
                             const std::vector<size_t>& starts) {
  const PredictorKernel& kernel = predictor_kernel(best_isa());
  std::vector<uint8_t> costs;
  costs.reserve(distances.size() * starts.size());
  for (const uint32_t distance : distances) {
    for (const size_t start : starts) {
      const uint8_t* block = frame.bytes.data() + start;
      costs.push_back(distance > start
                          ? kNothingYet
                          : static_cast<uint8_t>(kernel.predictor_cost(block, block - distance)));
    }
  }
  return costs;
}

/// Returns the saving of the samples by one more candidate.
uint64_t gain(const uint8_t* costs, const std::vector<uint8_t>& so_far) {
  uint64_t saved = 0;
  for (size_t s = 0; s < so_far.size(); ++s)
    saved += static_cast<uint64_t>(so_far[s] > costs[s] ? so_far[s] - costs[s] : 0);
  return saved;
}

}  // namespace

struct BandEncoder::State {
  State(size_t max_band_bytes, const PredictorKernel& functions, int largest_error)
      : kernel(functions),
        max_error(static_cast<uint8_t>(largest_error)),
        compressor(make_compressor()),
        coder(make_coder()),
        modes(blocks_of(max_band_bytes)),
        masks(blocks_of(max_band_bytes) * kMaskBytes),
        values(blocks_of(max_band_bytes) * kBlockBytes),
        packed(ZSTD_compressBound(values.size())),
        coded(packed.size()),
        window(max_error > 0 ? values.size() : 0) {}

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
  const uint8_t max_error;
  Compressor compressor;
  Compressor coder;
  std::vector<uint8_t> modes;
  std::vector<uint8_t> masks;
  std::vector<uint8_t> values;
  std::vector<uint8_t> packed;
  std::vector<uint8_t> coded;
  std::vector<uint8_t> window;  ///< the band that the decoder will have
  std::vector<uint8_t> plain;   ///< the other codec's payload, while two are compared
};

BandEncoder::BandEncoder(size_t max_band_bytes, Isa isa, int max_error)
    : state_(std::make_unique<State>(max_band_bytes, predictor_kernel(isa), max_error)) {
  LENTICULE_CHECK(max_error >= 0 && max_error <= kMostMaxError);
}
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
    s.kernel.encode_blocks(predictors,
                           {.band = band.data(),
                            .bytes = band.size(),
                            .max_error = s.max_error,
                            .window = s.window.data()},
                           out);
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

PredictorTable choose_predictors(const FrameView& frame, int band_rows) {
  const std::vector<uint32_t> distances = candidates(frame.geometry, band_rows);
  const std::vector<size_t> starts = sample_blocks(frame.geometry, band_rows);
  const std::vector<uint8_t> costs = measure(frame, distances, starts);
  std::vector<uint8_t> so_far(starts.size(), kNothingYet);
  PredictorTable predictors;
  while (predictors.count < kMaxPredictors) {
    size_t best = 0;
    uint64_t best_gain = 0;
    for (size_t c = 0; c < distances.size(); ++c) {
      const uint64_t saved = gain(&costs[c * starts.size()], so_far);
      if (saved > best_gain) {
        best_gain = saved;
        best = c;
      }
    }
    if (best_gain == 0) break;
    predictors.distance[++predictors.count] = distances[best];
    const uint8_t* chosen = &costs[best * starts.size()];
    for (size_t s = 0; s < starts.size(); ++s) so_far[s] = std::min(so_far[s], chosen[s]);
  }
  return predictors;
}

const PredictorKernel& predictor_kernel(Isa isa) {
#if defined(__x86_64__)
  if (!__builtin_cpu_supports("avx512vbmi2")) isa = std::min(isa, Isa::Avx2);
#endif
  return LENTICULE_SELECT_KERNEL(isa, kPredictorKernel);
}

}  // namespace lenticule::frames
