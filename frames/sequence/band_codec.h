// SPDX-License-Identifier: Apache-2.0
// Compresses one band of a frame independently of all other bands, without loss or within a largest
// error of every byte. The payload's
// layout is in docs/content/formats.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "frames/frame.h"
#include "frames/sequence/predictor_kernel.h"

namespace lenticule::frames {

enum class BandCodec : uint8_t {
  Raw = 0,        ///< uncompressed bytes
  Zstd = 1,       ///< one zstd frame
  Predicted = 2,  ///< blocks predicted from earlier bytes of the band, three zstd streams
};
inline constexpr uint8_t kBandCodecs = 3;

/// BandEncoder compresses bands. A payload is never larger than the band: Raw is the fallback.
class BandEncoder {
 public:
  /// Allocates for bands of at most `max_band_bytes`. Decoded bytes will be at most `max_error`
  /// off, 0 (without loss) to kMostMaxError. Throws std::bad_alloc.
  explicit BandEncoder(size_t max_band_bytes, Isa isa = best_isa(), int max_error = 0);
  ~BandEncoder();
  BandEncoder(BandEncoder&&) noexcept;
  BandEncoder& operator=(BandEncoder&&) noexcept;

  /// Encodes with the codec that gives the smallest payload, and returns it. Replaces `payload`.
  BandCodec encode(std::span<const uint8_t> band, const PredictorTable& predictors,
                   std::vector<uint8_t>& payload);
  /// Encodes with the given codec. Returns false if the payload would be larger than the band.
  [[nodiscard]] bool encode_as(BandCodec codec, std::span<const uint8_t> band,
                               const PredictorTable& predictors, std::vector<uint8_t>& payload);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

class BandDecoder {
 public:
  /// Allocates all memory, for bands of at most `max_band_bytes`.
  explicit BandDecoder(size_t max_band_bytes, Isa isa = best_isa());
  ~BandDecoder();
  BandDecoder(BandDecoder&&) noexcept;
  BandDecoder& operator=(BandDecoder&&) noexcept;

  /// Returns false for a payload that does not decode to exactly band.size() bytes; `band` is
  /// undefined then. Safe for any payload; neither allocates nor throws.
  [[nodiscard]] bool decode(BandCodec codec, std::span<const uint8_t> payload,
                            std::span<uint8_t> band) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Chooses the distances from which a frame is predicted best. They are measured on the frame
// itself, so that the lens sheet need not be known, and views or quilts compress as well.

/// Every kPredictorInterval-th frame of a film chooses the predictors of the frames up to the next
/// choice: content changes slowly, and choosing takes about as long as compressing a frame.
inline constexpr uint64_t kPredictorInterval = 32;

/// Returns at most kMaxPredictors distances (predictors), the most useful first. Examines a fixed
/// sample of the blocks: the same frame gives the same predictors on every machine. `band_rows` is
/// the container's value.
[[nodiscard]] PredictorTable choose_predictors(const FrameView& frame, int band_rows);

}  // namespace lenticule::frames
