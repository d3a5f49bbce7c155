// SPDX-License-Identifier: Apache-2.0
#include "lab/judges/codec_trial.h"

#include <zstd.h>

#include <cstring>
#include <optional>
#include <vector>

#include "base/error.h"
#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_format.h"

namespace lenticule::lab {
namespace {

struct StoredBand {
  frames::BandCodec codec = frames::BandCodec::Raw;
  std::vector<uint8_t> bytes;
};

// Works row by row, so that the compiler vectorises the loop and the comparison is fair.
void subtract_row(const uint8_t* row, const uint8_t* above, uint8_t* __restrict to, size_t bytes) {
  for (size_t i = 0; i < bytes; ++i) to[i] = static_cast<uint8_t>(row[i] - above[i]);
}
void add_row(const uint8_t* rest, const uint8_t* above, uint8_t* __restrict to, size_t bytes) {
  for (size_t i = 0; i < bytes; ++i) to[i] = static_cast<uint8_t>(rest[i] + above[i]);
}

}  // namespace

struct CodecTrial::State {
  ~State() {
    ZSTD_freeCCtx(compressor);
    ZSTD_freeDCtx(decompressor);
  }

  void compress(std::span<const uint8_t> bytes, std::vector<uint8_t>& to) const {
    to.resize(ZSTD_compressBound(bytes.size()));
    const size_t size =
        ZSTD_compressCCtx(compressor, to.data(), to.size(), bytes.data(), bytes.size(), level);
    LENTICULE_CHECK(ZSTD_isError(size) == 0);
    to.resize(size);
  }
  [[nodiscard]] bool decompress(const std::vector<uint8_t>& from, std::span<uint8_t> to) const {
    return ZSTD_decompressDCtx(decompressor, to.data(), to.size(), from.data(), from.size()) ==
           to.size();
  }

  void encode_band(std::span<const uint8_t> band, StoredBand& stored) {
    const size_t row = header.geometry.row_bytes();
    if (kind == TrialKind::Copy) stored.bytes.assign(band.begin(), band.end());
    if (kind == TrialKind::Zstd) compress(band, stored.bytes);
    if (kind == TrialKind::Container)
      stored.codec = encoder->encode(band, predictors, stored.bytes);
    if (kind != TrialKind::RowAbove) return;
    std::memcpy(rest.data(), band.data(), row);
    for (size_t at = row; at < band.size(); at += row)
      subtract_row(&band[at], &band[at - row], &rest[at], row);
    compress(std::span(rest).first(band.size()), stored.bytes);
  }

  [[nodiscard]] bool decode_band(const StoredBand& stored, std::span<uint8_t> band) {
    const size_t row = header.geometry.row_bytes();
    if (kind == TrialKind::Zstd) return decompress(stored.bytes, band);
    if (kind == TrialKind::Container) return decoder->decode(stored.codec, stored.bytes, band);
    if (kind == TrialKind::Copy) {
      std::memcpy(band.data(), stored.bytes.data(), band.size());
      return true;
    }
    if (!decompress(stored.bytes, std::span(rest).first(band.size()))) return false;
    std::memcpy(band.data(), rest.data(), row);
    for (size_t at = row; at < band.size(); at += row)
      add_row(&rest[at], &band[at - row], &band[at], row);
    return true;
  }

  void prepare(const frames::FrameGeometry& geometry) {
    if (header.geometry == geometry) return;
    header.geometry = geometry;
    header.band_rows = choose_band_rows(geometry);
    bands.resize(static_cast<size_t>(header.bands()));
    rest.resize(header.band_bytes(0));
    encoder.emplace(header.band_bytes(0), best_isa(), kind == TrialKind::Container ? level : 0);
    decoder.emplace(header.band_bytes(0));
  }

  TrialKind kind = TrialKind::Copy;
  int level = 0;
  ZSTD_CCtx* compressor = ZSTD_createCCtx();
  ZSTD_DCtx* decompressor = ZSTD_createDCtx();
  frames::FileHeader header;
  frames::PredictorTable predictors;
  std::vector<StoredBand> bands;
  std::vector<uint8_t> rest;
  std::optional<frames::BandEncoder> encoder;
  std::optional<frames::BandDecoder> decoder;
};

CodecTrial::CodecTrial(TrialKind kind, int level) : state_(std::make_unique<State>()) {
  state_->kind = kind;
  state_->level = level;
}
CodecTrial::~CodecTrial() = default;
CodecTrial::CodecTrial(CodecTrial&&) noexcept = default;
CodecTrial& CodecTrial::operator=(CodecTrial&&) noexcept = default;

size_t CodecTrial::encode(const frames::FrameView& frame) {
  State& s = *state_;
  s.prepare(frame.geometry);
  if (s.kind == TrialKind::Container) s.predictors = choose_predictors(frame, s.header.band_rows);
  size_t bytes = 0;
  for (int band = 0; band < s.header.bands(); ++band) {
    StoredBand& stored = s.bands[static_cast<size_t>(band)];
    s.encode_band(frame.bytes.subspan(s.header.band_offset(band), s.header.band_bytes(band)),
                  stored);
    bytes += stored.bytes.size();
  }
  return bytes;
}

bool CodecTrial::decode(frames::WovenFrame& to) {
  State& s = *state_;
  bool whole = true;
  for (int band = 0; band < s.header.bands(); ++band) {
    const std::span<uint8_t> pixels =
        to.bytes().subspan(s.header.band_offset(band), s.header.band_bytes(band));
    whole = s.decode_band(s.bands[static_cast<size_t>(band)], pixels) && whole;
  }
  return whole;
}

}  // namespace lenticule::lab
