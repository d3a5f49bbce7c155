// SPDX-License-Identifier: Apache-2.0
// FrameDecoder decodes frames of an open container, in one thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_layout.h"

namespace lenticule::frames {

/// FrameDecoder allocates all memory in its constructor.
///
/// Lifetime: `layout` must outlive the decoder.
class FrameDecoder {
 public:
  FrameDecoder(int fd, const SequenceLayout& layout);

  /// Decodes a frame into `to` (frame_bytes() long). Returns false if any byte of the frame is
  /// damaged or cannot be read; `to` is undefined then. Neither throws nor allocates.
  [[nodiscard]] bool decode(uint64_t frame, std::span<uint8_t> to) noexcept;
  /// Checks only the checksums. Returns the same result as decode().
  [[nodiscard]] bool check(uint64_t frame) noexcept;

 private:
  [[nodiscard]] bool read_payload(const BandEntry& entry) noexcept;

  int fd_;
  const SequenceLayout& layout_;
  BandDecoder decoder_;
  std::vector<BandEntry> entries_;
  std::vector<uint8_t> table_;
  std::vector<uint8_t> payload_;
};

}  // namespace lenticule::frames
