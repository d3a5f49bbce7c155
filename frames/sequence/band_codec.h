// SPDX-License-Identifier: Apache-2.0
// One band of a frame, compressed without loss and independently of all others. The payload's
// layout is in docs/formats.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/cpu.h"
#include "frames/sequence/tap_kernel.h"

namespace lenticule::frames {

enum class BandCodec : uint8_t {
  Raw = 0,   ///< the bytes
  Zstd = 1,  ///< one zstd frame
  Taps = 2,  ///< blocks predicted from other places of the band, three zstd streams
};
inline constexpr uint8_t kBandCodecs = 3;

/// A payload is never larger than the band: Raw is the way out.
class BandEncoder {
 public:
  /// For bands of at most `max_band_bytes`. Throws std::bad_alloc.
  explicit BandEncoder(size_t max_band_bytes, Isa isa = best_isa());
  ~BandEncoder();
  BandEncoder(BandEncoder&&) noexcept;
  BandEncoder& operator=(BandEncoder&&) noexcept;

  /// Whichever codec is smallest. Replaces `payload`.
  BandCodec encode(std::span<const uint8_t> band, const TapTable& taps,
                   std::vector<uint8_t>& payload);
  /// With the codec that is asked for; false if its payload would be larger than the band.
  [[nodiscard]] bool encode_as(BandCodec codec, std::span<const uint8_t> band, const TapTable& taps,
                               std::vector<uint8_t>& payload);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

class BandDecoder {
 public:
  /// For bands of at most `max_band_bytes`; everything is allocated here.
  explicit BandDecoder(size_t max_band_bytes, Isa isa = best_isa());
  ~BandDecoder();
  BandDecoder(BandDecoder&&) noexcept;
  BandDecoder& operator=(BandDecoder&&) noexcept;

  /// False for a payload that does not decode to exactly band.size() bytes, which then hold
  /// anything. Safe for any payload; neither allocates nor throws.
  [[nodiscard]] bool decode(BandCodec codec, std::span<const uint8_t> payload,
                            std::span<uint8_t> band) noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lenticule::frames
