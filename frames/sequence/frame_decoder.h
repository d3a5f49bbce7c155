// SPDX-License-Identifier: Apache-2.0
// Frames of an open container, decoded by one thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "frames/sequence/band_codec.h"
#include "frames/sequence/sequence_layout.h"

namespace lenticule::frames {

/// Everything is allocated by the constructor. `layout` must outlive the decoder.
class FrameDecoder {
 public:
  FrameDecoder(int fd, const SequenceLayout& layout);

  /// False if any byte of the frame is not what was written, or cannot be read; `to`
  /// (frame_bytes() long) then holds anything. Neither throws nor allocates.
  [[nodiscard]] bool decode(uint64_t frame, std::span<uint8_t> to) noexcept;
  /// As decode(), but only looks at the checksums.
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
