// SPDX-License-Identifier: Apache-2.0
// Pre-rendered frames from a sequence container, decoded ahead by threads of their own into a
// bounded pool. What is damaged is replaced and counted; playing goes on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "frames/decoded_source.h"
#include "frames/sequence/sequence_reader.h"

namespace lenticule::frames {

struct SequenceSourceOptions {
  int pool_frames = 8;      ///< decoded frames in memory at most, at least 2; allocated at once
  int decoder_threads = 1;  ///< 1..64, each works on a frame of its own
  /// Frames [begin, end) of the file, 0-based, instead of all; must not be empty.
  uint64_t begin = 0;
  std::optional<uint64_t> end = std::nullopt;
  /// With how many of them left out the first round begins; as many as there are count as none.
  uint64_t first = 0;
  /// A longer file is read past the page cache, a shorter one stays in it.
  uint64_t cached_file_bytes = uint64_t{1} << 30;
};

/// The first round is played from the first frame to the end of the loop, every later one from the
/// beginning of the loop to its end, without a gap. A loop that fits the pool is decoded once.
///
/// A frame with a damaged band is replaced by the nearest whole one before it (after it, at the
/// start). Only where none of the 64 on either side can be read the source has Failed.
class SequenceSource final : public DecodedSource {
 public:
  /// Throws Error(Input) as SequenceReader does, for a file without a frame, and for a range that
  /// the file does not have.
  explicit SequenceSource(const std::filesystem::path& file,
                          const SequenceSourceOptions& options = {});

  [[nodiscard]] const SequenceInfo& info() const;
  /// Frames that were decoded and were not what had been written: each was replaced.
  [[nodiscard]] uint64_t damaged_frames() const;
  [[nodiscard]] FrameDamage damage() const override {
    return {.damaged = damaged_frames(), .repeated = damaged_frames()};
  }

 private:
  class Frames;

  const Frames& frames_;  ///< owned by DecodedSource
};

}  // namespace lenticule::frames
